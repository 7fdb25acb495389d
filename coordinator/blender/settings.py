"""What the user chooses: of a scene, and in the preferences."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty


class HALFLIGHT_Settings(bpy.types.PropertyGroup):
    """What is baked of a scene."""

    quality: EnumProperty(
        name="Quality",
        items=[
            ("DRAFT", "Draft", "To see where light falls, 10 % error"),
            ("PREVIEW", "Preview", "To work with, 5 % error"),
            ("FINAL", "Final", "To publish, 1 % error"),
        ],
        default="PREVIEW",
    )
    target: EnumProperty(
        name="Light",
        items=[
            ("ATTRIBUTE", "Colour Attribute", "Irradiance at the corners of faces, as fine as the mesh is"),
            ("LIGHTMAP", "Lightmap", "Irradiance in an image, with a UV map of its own"),
        ],
        default="ATTRIBUTE",
    )
    size: IntProperty(
        name="Size", description="Width and largest height of the lightmap", default=1024, min=16, max=4096, subtype="PIXEL"
    )
    show: BoolProperty(
        name="Show on Copies of Materials",
        description="Give objects copies of their materials that show the light; the materials themselves stay",
        default=False,
    )
    make_single: BoolProperty(
        name="Single User Meshes",
        description="Give each object that shares its mesh a mesh of its own; objects that share one get no light otherwise",
        default=False,
    )


class HALFLIGHT_Preferences(bpy.types.AddonPreferences):
    """Where Halflight runs."""

    bl_idname = __package__

    program: StringProperty(
        name="Program", description="Path of the program coordinator, or its name on PATH", default="coordinator", subtype="FILE_PATH"
    )
    where: EnumProperty(
        name="Bake",
        items=[
            ("LOCAL", "On this machine", "Run the program here"),
            ("SERVICE", "By a service", "Send the scene to a service"),
        ],
        default="LOCAL",
    )
    address: StringProperty(name="Service", description="HOST:PORT", default="127.0.0.1:7000")
    token_file: StringProperty(name="Token File", description="File with the token to send", subtype="FILE_PATH")
    ca_file: StringProperty(
        name="CA Certificate", description="Authority of the service's certificate, PEM; all traffic is then encrypted", subtype="FILE_PATH"
    )
    plaintext: BoolProperty(name="Without Encryption", description="For trusted networks only", default=False)

    def draw(self, _context):
        """Draws the preferences."""
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "program")
        layout.prop(self, "where")
        if self.where == "SERVICE":
            for name in ("address", "token_file", "ca_file", "plaintext"):
                layout.prop(self, name)


def preferences(context):
    """Returns the add-on's preferences."""
    return context.preferences.addons[__package__].preferences
