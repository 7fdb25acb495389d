"""The panel in the render properties."""

import textwrap

import bpy

from .settings import preferences

# Characters of a line in a panel of usual width.
COLUMNS = 60


class HALFLIGHT_PT_bake(bpy.types.Panel):
    """Settings and the button of a bake."""

    bl_idname = "HALFLIGHT_PT_bake"
    bl_label = "Halflight"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        """Draws the panel."""
        layout, settings, manager = self.layout, context.scene.halflight, context.window_manager
        layout.use_property_split = True
        layout.prop(settings, "quality")
        layout.prop(settings, "target")
        if settings.target == "LIGHTMAP":
            layout.prop(settings, "size")
        layout.prop(settings, "show")
        layout.prop(settings, "make_single")
        if preferences(context).where == "SERVICE":
            layout.label(text=f"By {preferences(context).address}", icon="URL")
        if manager.halflight_status:
            layout.label(text=f"{manager.halflight_status} (Esc cancels)", icon="TIME")
        layout.operator("halflight.bake", icon="LIGHT_AREA")
        layout.operator("halflight.hide")
        column = layout.column(align=True)
        for note in manager.halflight_notes.splitlines():
            for index, line in enumerate(textwrap.wrap(note, COLUMNS)):
                column.label(text=line, icon="BLANK1" if index else "ERROR")
