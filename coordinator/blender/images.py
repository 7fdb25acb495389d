"""Pages of a lightmap as images of Blender, with irradiance as floats."""

import bpy
import numpy as np

from . import gltf, lightmap
from .meshes import UNIT
from .nodes import NAME


def page(document, binary, index, lit, scene):
    """Returns a page of a lit file (a Path) as a packed bpy.types.Image of linear irradiance, in the file's unit.

    It takes the place of the page that the scene of this name had before.
    Pages of OpenEXR stand beside the lit file; those of a service are in it, as RGBM.
    """
    beside = lit.with_name(f"{lit.stem}-lightmap-{index}.exr")
    image = bpy.data.images.load(str(beside)) if beside.exists() else _decoded(document, binary, index, lit)
    image.pack()
    image[UNIT] = document["asset"]["extras"]["halflight"]["unit"]
    name = f"{NAME} {scene} {index}"
    image.filepath_raw = f"//{name}.exr"
    older = bpy.data.images.get(name)
    if older is not None:
        older.user_remap(image)
        bpy.data.images.remove(older)
    image.name = name
    image.use_fake_user = True
    return image


def _decoded(document, binary, index, lit):
    entry = document["asset"]["extras"]["halflight"]["lightmap"]
    if entry["encoding"] != "rgbm":
        raise gltf.GltfError(f"page {index} of the lightmap is missing beside the lit file")
    file = lit.with_name(f"page-{index}.png")
    file.write_bytes(gltf.image_bytes(document, binary, entry["textures"][index]))
    encoded = bpy.data.images.load(str(file))
    try:
        encoded.colorspace_settings.name, encoded.alpha_mode = "Non-Color", "CHANNEL_PACKED"
        width, height = encoded.size
        pixels = np.empty(width * height * 4, np.float32)
        encoded.pixels.foreach_get(pixels)
    finally:
        bpy.data.images.remove(encoded)
    light = np.ones((height, width, 4), np.float32)
    light[..., :3] = lightmap.decode_rgbm(pixels.reshape(height, width, 4), entry["scale"])
    image = bpy.data.images.new(NAME, width, height, float_buffer=True)
    image.pixels.foreach_set(light.ravel())
    return image
