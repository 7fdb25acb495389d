"""Lightmaps of a lit file: which page lights a material, where on it, and its pixels. Needs no Blender."""

from dataclasses import dataclass

import numpy as np

from .gltf import LIGHTMAP


@dataclass(frozen=True)
class Place:
    """Where the light of a material is: the page, the vertex attribute with coordinates, and a part of the page or None."""

    page: int
    attribute: str
    transform: dict | None


def place(document, material):
    """Returns the place of a material's light, or None where it has no lightmap. `material` is an index, or None."""
    if material is None or material < 0:
        return None
    entry = document["materials"][material].get("extensions", {}).get(LIGHTMAP)
    if entry is None:
        return None
    transform = entry.get("extensions", {}).get("KHR_texture_transform")
    texture_set = (transform or {}).get("texCoord", entry.get("texCoord", 0))
    page = document["asset"]["extras"]["halflight"]["lightmap"]["textures"].index(entry["index"])
    return Place(page, f"TEXCOORD_{texture_set}", transform)


def on_page(coordinates, transform):
    """Turns coordinates (..., 2) of a file into those of Blender's images, whose origin is below, on the part of the page."""
    coordinates = np.asarray(coordinates, float)
    if transform:
        angle = transform.get("rotation", 0.0)
        # As KHR_texture_transform has it: scale, then turn, then move.
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        coordinates = coordinates * transform.get("scale", (1, 1)) @ turn.T + transform.get("offset", (0, 0))
    return np.stack([coordinates[..., 0], 1 - coordinates[..., 1]], axis=-1)


def decode_rgbm(pixels, scale):
    """Returns the irradiance (h, w, 3), in the file's unit, of the linear values (h, w, 4) of a page in RGBM."""
    return pixels[..., :3] * pixels[..., 3:] * scale
