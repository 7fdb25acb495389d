"""Bake with Halflight: diffuse global illumination of a scene, baked on to its own meshes."""

import bpy
from bpy.props import PointerProperty, StringProperty

from .operators import HALFLIGHT_OT_bake, HALFLIGHT_OT_hide
from .panel import HALFLIGHT_PT_bake
from .runner import close_all
from .settings import HALFLIGHT_Preferences, HALFLIGHT_Settings

CLASSES = (HALFLIGHT_Settings, HALFLIGHT_Preferences, HALFLIGHT_OT_bake, HALFLIGHT_OT_hide, HALFLIGHT_PT_bake)


def register():
    """Adds the panel, the operators and their settings to Blender."""
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.halflight = PointerProperty(type=HALFLIGHT_Settings)
    # Of the running Blender, not of a file.
    bpy.types.WindowManager.halflight_status = StringProperty(options={"SKIP_SAVE"})
    bpy.types.WindowManager.halflight_notes = StringProperty(options={"SKIP_SAVE"})


def unregister():
    """Ends bakes that run, and removes what [register] added."""
    close_all()
    del bpy.types.WindowManager.halflight_notes
    del bpy.types.WindowManager.halflight_status
    del bpy.types.Scene.halflight
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
