"""The world of a Blender scene as the sky of a bake."""

import math
from pathlib import Path

import bpy
import numpy as np

from .arguments import Sky
from .lamps import surface_node

READ = "only a Background with a colour, or with an Environment Texture that is turned about Z, is read"
FORMATS = {".hdr", ".exr"}


def sky(world, folder):
    """Returns the sky (radiance in W/(m^2 sr)) of a bpy.types.World or None, and notes for the user.

    Images that are no HDR or EXR files are written to the folder.
    """
    if world is None:
        return Sky(), []
    if not world.use_nodes or world.node_tree is None:
        return Sky(colour=tuple(world.color)), []
    background = surface_node(world.node_tree, "OUTPUT_WORLD")
    if background is None:
        return Sky(), []
    left_out = [f"world {world.name} left out: {READ}"]
    if background.type != "BACKGROUND" or background.inputs["Strength"].is_linked:
        return Sky(), left_out
    strength, colour = background.inputs["Strength"].default_value, background.inputs["Color"]
    if strength <= 0:
        return Sky(), []
    if not colour.is_linked:
        return Sky(colour=tuple(strength * part for part in colour.default_value[:3])), []
    texture = colour.links[0].from_node
    rotation = _rotation(texture)
    if rotation is None or texture.image is None:
        return Sky(), left_out
    return Sky(image=image_file(texture.image, folder), rotation=rotation, intensity=strength), []


def _rotation(texture):
    """Returns by how many degrees an Environment Texture is turned counter-clockwise, seen from above, or None where it is unread."""
    if texture.type != "TEX_ENVIRONMENT" or texture.projection != "EQUIRECTANGULAR":
        return None
    if not texture.inputs["Vector"].is_linked:
        return 0.0
    mapping = texture.inputs["Vector"].links[0].from_node
    if mapping.type == "TEX_COORD":
        return 0.0
    if mapping.type != "MAPPING" or any(mapping.inputs[name].is_linked for name in ("Rotation", "Scale")):
        return None
    tilt_x, tilt_y, turn = mapping.inputs["Rotation"].default_value
    scale = mapping.inputs["Scale"].default_value
    if max(abs(tilt_x), abs(tilt_y)) > 1e-6 or any(abs(part - 1) > 1e-6 for part in scale):
        return None
    if mapping.vector_type in ("POINT", "TEXTURE") and "Location" in mapping.inputs:
        if mapping.inputs["Location"].is_linked or any(mapping.inputs["Location"].default_value):
            return None
    # Mapping turns the directions that are looked up, and so the image the other way; as a texture it turns the image.
    return math.degrees(turn if mapping.vector_type == "TEXTURE" else -turn)


def image_file(image, folder):
    """Returns an HDR or EXR file with a bpy.types.Image: its own, or one that is written to the folder."""
    own = Path(bpy.path.abspath(image.filepath)) if image.filepath else None
    is_kept = own is not None and own.is_file() and not image.packed_file and not image.is_dirty
    if is_kept and image.source == "FILE" and own.suffix.lower() in FORMATS and image.colorspace_settings.name == "Linear Rec.709":
        return own
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    if not image.is_float and image.colorspace_settings.name == "sRGB":
        colour = pixels.reshape(-1, 4)[:, :3]
        colour[:] = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    # Blender itself would write the curve of sRGB into files of new float images.
    file = Path(folder) / "sky.hdr"
    file.write_bytes(radiance_file(pixels.reshape(height, width, 4)[::-1, :, :3]))
    return file


def radiance_file(pixels):
    """Returns the bytes of a Radiance (.hdr) file with linear RGB (h, w, 3), the first row on top; a channel keeps 8 bits."""
    height, width, _ = pixels.shape
    light = np.clip(np.nan_to_num(pixels, posinf=1e30), 0, 1e30)
    brightest = light.max(axis=2)
    _, exponent = np.frexp(brightest)
    written = np.zeros((height, width, 4), np.uint8)
    written[..., :3] = np.minimum(light * np.exp2(8.0 - exponent)[..., None], 255)
    written[..., 3] = np.where(brightest > 1e-30, exponent + 128, 0)
    return f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode() + written.tobytes()
