"""Brings the light of a lit file back on to the user's meshes."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from . import gltf, images, lightmap, matching, meshes, nodes

IRRADIANCE = "_IRRADIANCE"


@dataclass
class Brought:
    """The objects that have light, by name; its unit; and notes for the user."""

    objects: list = field(default_factory=list)
    unit: str = ""
    notes: list = field(default_factory=list)


def bring(context, lit, as_lightmap, show, make_single):
    """Brings the light of a lit file (a Path) on to the scene's meshes, and returns what was done.

    `as_lightmap` writes images and the UV map Halflight UV, else the colour attribute Halflight; `show` gives objects copies of their
    materials that show the light; `make_single` gives objects that share a mesh one of their own.
    """
    document, binary = gltf.read_glb(lit.read_bytes())
    found = gltf.Nodes(document)
    result = Brought(unit=document["asset"]["extras"]["halflight"]["unit"])
    owners = [owner for owner in context.scene.objects if owner.type == "MESH" and not owner.hide_render]
    shared = Counter(owner.data for owner in context.scene.objects if owner.type == "MESH")
    pages, copies = {}, {}
    for owner in owners:
        node = found.find(owner.name, owner.matrix_world)
        own, problem = _own(context, owner, node, shared, make_single)
        if problem:
            result.notes.append(f"{owner.name} has no light: {problem}")
        if own is None:
            continue
        if as_lightmap:
            group, problem = _as_lightmap(document, binary, node, owner, own, pages, (lit, context.scene.name))
        else:
            group, problem = _as_colours(document, binary, node, owner, own)
        if problem:
            result.notes.append(f"{owner.name}{problem}")
        if group is None:
            continue
        result.objects.append(owner.name)
        if show:
            result.notes += nodes.show_light(owner, group, copies)
    result.notes = list(dict.fromkeys(result.notes + _without_meshes(context)))
    return result


def _own(context, owner, node, shared, make_single):
    """Returns the triangles of an object, or None, and the reason if the user can do something about it."""
    mesh = owner.data
    if not len(mesh.polygons):
        return None, ""
    if node is None:
        # What is hidden was left out by the exporter.
        return None, "it was not in the bake where it is now; bake again" if owner.visible_get() else ""
    if mesh.library or not mesh.is_editable:
        return None, "its mesh belongs to another file; make it local"
    if owner.mode == "EDIT":
        return None, "it is being edited; leave edit mode and bake again"
    if shared[mesh] > 1:
        if not make_single:
            return None, "it shares its mesh with other objects, that have other light; choose Single User Meshes"
        shared[mesh] -= 1
        owner.data = mesh.copy()
        context.view_layer.update()
    own = meshes.triangles(owner, context.evaluated_depsgraph_get())
    if own is None:
        return None, "its modifiers make other faces than its mesh has; apply them and bake again"
    return own, ""


def _as_colours(document, binary, node, owner, own):
    lit, values, _ = gltf.lit_triangles(document, binary, node, IRRADIANCE)
    if not len(lit):
        return None, " has no light: the lit file holds nothing of it"
    light, has_light = matching.values_at_corners(own.triangles, own.corners, own.count, lit, values)
    unit = document["asset"]["extras"]["halflight"]["unit"]
    meshes.write_colours(owner.data, light, unit)
    return nodes.light_group(), _dark(has_light)


def _as_lightmap(document, binary, node, owner, own, pages, source):
    def attribute(material):
        place = lightmap.place(document, material)
        return place and place.attribute

    lit, values, materials = gltf.lit_triangles(document, binary, node, attribute)
    if not len(lit):
        return None, " has no light: the lit file has no lightmap of it"
    places = {material: lightmap.place(document, int(material)) for material in np.unique(materials)}
    for material, place in places.items():
        values[materials == material] = lightmap.on_page(values[materials == material], place.transform)
    found = matching.coordinates_at_corners(own.triangles, own.corners, own.count, lit, values)
    coordinates, has_any, on = found
    used = Counter(places[material].page for material in materials[on[on >= 0]])
    if not used:
        return None, " has no light: the lit file holds nothing of it"
    if not meshes.write_coordinates(owner.data, coordinates, document["asset"]["extras"]["halflight"]["unit"]):
        return None, " has no light: it has as many UV maps as Blender allows; remove one"
    index = used.most_common(1)[0][0]
    if index not in pages:
        pages[index] = nodes.light_group(images.page(document, binary, index, *source))
    if len(used) > 1:
        return pages[index], " is lit by several pages, and shows one; choose a larger lightmap"
    return pages[index], _dark(has_any)


def _dark(has_light):
    missing = len(has_light) - int(has_light.sum())
    return f": {missing} of {len(has_light)} corners have no light, where other surfaces lie on them" if missing else ""


def _without_meshes(context):
    """Returns notes on what was baked but takes no light."""
    notes = []
    for owner in context.scene.objects:
        if owner.hide_render:
            continue
        if owner.type in {"CURVE", "SURFACE", "FONT", "META"}:
            notes.append(f"{owner.name} has no light: it is no mesh; convert it")
        elif owner.type == "EMPTY" and owner.instance_collection:
            notes.append(f"{owner.name} has no light: it is a collection instance; make it real")
    return notes
