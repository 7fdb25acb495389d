"""The user's meshes: their triangles as they were exported, and light written to their corners."""

from dataclasses import dataclass

import numpy as np

from .gltf import to_gltf
from .nodes import NAME, UV_NAME

# On a mesh or an image with light: its unit.
UNIT = "halflight_unit"


@dataclass
class OwnMesh:
    """Triangles (f, 3, 3) of an object in its own axes, turned to glTF's, and the corner of a face (f, 3) at each of theirs."""

    triangles: np.ndarray
    corners: np.ndarray
    count: int


def triangles(owner, depsgraph):
    """Returns an object's mesh as it is shown, or None where modifiers leave other corners than the mesh itself has."""
    evaluated = owner.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        count = len(mesh.loops)
        if count != len(owner.data.loops) or not np.array_equal(_corner_vertices(mesh), _corner_vertices(owner.data)):
            return None
        mesh.calc_loop_triangles()
        corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
        mesh.loop_triangles.foreach_get("loops", corners)
        places = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", places)
        at = to_gltf(places.reshape(-1, 3))[_corner_vertices(mesh)]
        return OwnMesh(at[corners].reshape(-1, 3, 3), corners.reshape(-1, 3), count)
    finally:
        evaluated.to_mesh_clear()


def _corner_vertices(mesh):
    found = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", found)
    return found


def write_colours(mesh, irradiance, unit):
    """Writes irradiance (corners, 3) as the colour attribute Halflight: floats at face corners, in the unit."""
    colours = mesh.color_attributes
    there = mesh.attributes.get(NAME)
    if there is not None and (there.data_type, there.domain) != ("FLOAT_COLOR", "CORNER"):
        mesh.attributes.remove(there)
        there = None
    # A new attribute must not become the one that materials show, if they show one.
    shown = (colours.active_color_index, colours.render_color_index) if len(colours) else None
    if there is None:
        there = colours.new(name=NAME, type="FLOAT_COLOR", domain="CORNER")
    if shown:
        colours.active_color_index, colours.render_color_index = shown
    values = np.ones((len(irradiance), 4), np.float32)
    values[:, :3] = irradiance
    mesh.attributes[NAME].data.foreach_set("color", values.ravel())
    mesh[UNIT] = unit
    mesh.update()


def write_coordinates(mesh, coordinates, unit):
    """Writes coordinates (corners, 2) as the UV map Halflight UV; returns False where the mesh has as many as Blender allows."""
    layers = mesh.uv_layers
    active = layers.active.name if layers.active else None
    shown = next((layer.name for layer in layers if layer.active_render), None)
    if layers.get(UV_NAME) is None and layers.new(name=UV_NAME, do_init=False) is None:
        return False
    layers[UV_NAME].uv.foreach_set("vector", np.asarray(coordinates, np.float32).ravel())
    # Textures without a UV map of their own go on showing the one that they showed.
    if active:
        layers.active = layers[active]
    if shown:
        layers[shown].active_render = True
    mesh[UNIT] = unit
    mesh.update()
    return True
