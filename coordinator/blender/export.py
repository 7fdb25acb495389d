"""The scene as a file for the program: Blender's own glTF exporter, and what that leaves out."""

import contextlib
from pathlib import Path

import bpy
import numpy as np

from . import gltf, lamps
from .nodes import ORIGINAL, UV_NAME
from .runner import BakeError


def export(context, file):
    """Writes the scene to a .glb file; returns notes for the user.

    Hidden for rendering is hidden from the bake. Materials that show the light of an earlier bake count as what they are copies of.
    """
    with originals(context.scene):
        try:
            bpy.ops.export_scene.gltf(
                filepath=str(file), check_existing=False, export_format="GLB", export_yup=True,
                export_lights=True, export_import_convert_lighting_mode="SPEC", export_cameras=False,
                use_active_scene=True, use_renderable=True, export_apply=True,
                export_skins=False, export_morph=False, export_animations=False,
                export_draco_mesh_compression_enable=False, export_gpu_instances=False, export_attributes=False,
                export_texcoords=True, export_normals=True, export_materials="EXPORT", export_extras=False,
            )
        except RuntimeError as problem:
            raise BakeError(f"the scene cannot be exported: {problem}") from problem
    document, binary = gltf.read_glb(Path(file).read_bytes())
    gltf.give_materials(document)
    _drop_earlier(context.scene, document)
    found, notes = _lamps(context, document)
    gltf.add_area_lights(document, found)
    Path(file).write_bytes(gltf.write_glb(document, binary))
    return notes


def _drop_earlier(scene, document):
    """Leaves out the coordinates of an earlier lightmap: the baker would find them on some meshes, and not on others."""
    nodes = gltf.Nodes(document)
    for owner in scene.objects:
        layers = owner.data.uv_layers.keys() if owner.type == "MESH" else ()
        if layers and layers[-1] == UV_NAME:
            node = nodes.find(owner.name, owner.matrix_world)
            if node is not None:
                gltf.drop_coordinates(document, node, len(layers) - 1)


@contextlib.contextmanager
def originals(scene):
    """Shows, as long as it lasts, the materials that copies with light were made of."""
    changed = []
    for owner in scene.objects:
        for slot in owner.material_slots:
            original = slot.material.get(ORIGINAL) if slot.material else None
            if original is not None:
                changed.append((slot, slot.material))
                slot.material = original
    try:
        yield
    finally:
        for slot, material in changed:
            slot.material = material


def _lamps(context, document):
    """Returns pairs of a node and an area lamp, and notes on lamps of all kinds."""
    nodes = gltf.Nodes(document)
    found, notes = [], []
    for lamp, matrix in _placed_lamps(context):
        light = lamp.data
        if light.type in lamps.PUNCTUAL:
            notes += lamps.shadowless(lamp.name, light)
            continue
        area, own_notes = lamps.area(lamp.name, light, matrix)
        notes += own_notes
        if area is None:
            continue
        node = nodes.find(lamp.name, matrix, has_mesh=False)
        if node is None:
            notes.append(f"lamp {lamp.name} left out: Blender's exporter wrote no node for it")
        else:
            found.append((node, area))
    return found, list(dict.fromkeys(notes))


def _placed_lamps(context):
    """Returns each lamp that shines in renders with its matrix to the world, those of shown collections too."""
    for owner in context.scene.objects:
        if owner.type == "LIGHT" and not owner.hide_render:
            yield owner, np.array(owner.matrix_world)
    for instance in context.evaluated_depsgraph_get().object_instances:
        if instance.is_instance and instance.object.type == "LIGHT":
            yield instance.object.original, np.array(instance.matrix_world)
