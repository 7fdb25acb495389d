"""A bake from the scene to light on its meshes, in steps that never wait for the program."""

import functools

import bpy

from . import arguments, bringing, export, world
from .runner import BakeError, Runner, find_program


class SceneBake:
    """Exports the scene and starts the program; [poll] until it has ended, then [finish] or [close].

    Raises BakeError where the bake cannot begin; nothing is left behind then.
    """

    def __init__(self, context, preferences):
        settings = context.scene.halflight
        program = find_program(preferences.program)
        service = _service(preferences)
        self._settings = {
            "as_lightmap": settings.target == "LIGHTMAP", "show": settings.show, "make_single": settings.make_single,
        }
        self.runner = Runner()
        try:
            folder = self.runner.folder
            sky, self.notes = world.sky(context.scene.world, folder)
            size = settings.size if settings.target == "LIGHTMAP" else None
            asked = arguments.Bake(settings.quality.lower(), size, sky)
            scene, self._lit = folder / "scene.glb", folder / "lit.glb"
            if service:
                command = arguments.submit(program, scene, self._lit, asked, service)
            else:
                command = arguments.solve(program, scene, self._lit, asked)
            self.notes = self.notes + export.export(context, scene)
            self.runner.start(command, service and functools.partial(_cancel, program, service))
        except BaseException:
            self.runner.close()
            raise

    @property
    def progress(self):
        """The last progress that the program told, or None."""
        return self.runner.progress

    def poll(self):
        """Returns whether the program has ended. Never waits."""
        return self.runner.poll()

    def cancel(self):
        """Tells the program to end; [poll] tells when it has."""
        self.runner.cancel()

    def close(self):
        """Ends the program if it still runs, and removes its files."""
        self.runner.close()

    def finish(self, context):
        """Brings the light on to the meshes, removes the files, and returns a [bringing.Brought].

        Raises BakeError where the program failed.
        """
        try:
            self.runner.check()
            brought = bringing.bring(context, self._lit, **self._settings)
            brought.notes = self.notes + self.runner.warnings() + brought.notes
            return brought
        finally:
            self.close()


def _service(preferences):
    """Returns the service of the preferences, or None for the local program."""
    if preferences.where != "SERVICE":
        return None
    service = arguments.Service(
        preferences.address, bpy.path.abspath(preferences.token_file), bpy.path.abspath(preferences.ca_file), preferences.plaintext
    )
    if not service.is_local and not getattr(bpy.app, "online_access", True):
        raise BakeError("a service on another machine needs online access: allow it in Preferences > System > Network")
    return service


def _cancel(program, service, job):
    return arguments.cancel(program, job, service)
