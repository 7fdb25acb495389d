"""The operators: bake, and show materials without the light again."""

import bpy

from . import nodes
from .bake import SceneBake
from .gltf import GltfError
from .runner import BakeError
from .settings import preferences

# Seconds between two looks at the program.
INTERVAL = 0.2


class HALFLIGHT_OT_bake(bpy.types.Operator):
    """Bake the light of the scene with Halflight, and bring it on to its meshes"""

    bl_idname = "halflight.bake"
    bl_label = "Bake with Halflight"
    bl_options = {"REGISTER", "UNDO"}
    _running = False

    @classmethod
    def poll(cls, context):
        """Whether a bake can begin."""
        return context.mode == "OBJECT" and not HALFLIGHT_OT_bake._running

    def execute(self, context):
        """Bakes and waits, as scripts and Blender without windows need it."""
        try:
            bake = SceneBake(context, preferences(context))
            try:
                bake.runner.wait()
                return self._finish(context, bake)
            finally:
                bake.close()
        except BakeError as problem:
            return self._fail(context, problem)

    def invoke(self, context, _event):
        """Begins a bake and returns at once; without windows, waits for it."""
        return self.execute(context) if bpy.app.background else self._begin(context)

    def _begin(self, context):
        try:
            self._bake = SceneBake(context, preferences(context))
        except BakeError as problem:
            return self._fail(context, problem)
        HALFLIGHT_OT_bake._running, self._is_cancelled = True, False
        # The user may look at another scene meanwhile.
        self._scene = context.scene.name
        manager = context.window_manager
        self._timer = manager.event_timer_add(INTERVAL, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        self._tell(context, "starting")
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Looks at the program, and passes all events on but Esc."""
        if event.type == "ESC" and event.value == "PRESS" and not self._is_cancelled:
            self._is_cancelled = True
            self._bake.cancel()
            self._tell(context, "cancelling")
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if not self._bake.poll():
            progress = self._bake.progress
            if progress and not self._is_cancelled:
                context.window_manager.progress_update(round(100 * progress.part))
                self._tell(context, str(progress))
            return {"PASS_THROUGH"}
        if self._is_cancelled:
            self.cancel(context)
            self.report({"INFO"}, "Halflight: cancelled, nothing was changed")
            return {"CANCELLED"}
        self._leave(context)
        try:
            scene = bpy.data.scenes.get(self._scene)
            if scene is None or context.mode != "OBJECT" or scene != context.scene:
                raise BakeError(f"the light was not brought back: bake again, in object mode and in scene {self._scene}")
            return self._finish(context, self._bake)
        except BakeError as problem:
            return self._fail(context, problem)
        finally:
            self._bake.close()

    def cancel(self, context):
        """Ends the bake and leaves the scene as it was; Blender calls it, too, when a file is opened."""
        self._leave(context)
        self._bake.close()

    def _finish(self, context, bake):
        try:
            brought = bake.finish(context)
        except GltfError as problem:
            raise BakeError(f"the lit file cannot be read: {problem}") from problem
        for note in brought.notes:
            self.report({"WARNING"}, f"Halflight: {note}")
        context.window_manager.halflight_notes = "\n".join(brought.notes)
        self.report({"INFO"}, f"Halflight: {len(brought.objects)} objects have light, in {brought.unit}")
        return {"FINISHED"}

    def _fail(self, context, problem):
        context.window_manager.halflight_notes = str(problem)
        self.report({"ERROR"}, f"Halflight: {problem}")
        return {"CANCELLED"}

    def _tell(self, context, text):
        # There is no workspace when Blender ends.
        if context.workspace:
            context.workspace.status_text_set(f"Halflight: {text} (Esc cancels)" if text else None)
        context.window_manager.halflight_status = text
        for window in context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "PROPERTIES":
                    area.tag_redraw()

    def _leave(self, context):
        HALFLIGHT_OT_bake._running = False
        manager = context.window_manager
        manager.event_timer_remove(self._timer)
        manager.progress_end()
        self._tell(context, "")


class HALFLIGHT_OT_hide(bpy.types.Operator):
    """Give the objects of the scene the materials back that show no baked light"""

    bl_idname = "halflight.hide"
    bl_label = "Restore Materials"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        """Restores the materials."""
        for owner in context.scene.objects:
            if owner.type == "MESH":
                nodes.hide_light(owner)
        return {"FINISHED"}
