"""Shader nodes that show baked light, and copies of materials with them."""

import math

import bpy

NAME = "Halflight"
# Attributes and UV maps of a mesh share their names.
UV_NAME = "Halflight UV"
GROUP = "Halflight light"
# The copied material, on a copy.
ORIGINAL = "halflight_original"
INPUTS = [
    ("Base Color", "NodeSocketColor", (0.8, 0.8, 0.8, 1)),
    ("Metallic", "NodeSocketFloat", 0.0),
    ("Alpha", "NodeSocketFloat", 1.0),
    ("Emission Color", "NodeSocketColor", (1, 1, 1, 1)),
    ("Emission Strength", "NodeSocketFloat", 0.0),
]


def light_group(image=None):
    """Makes the node group that shows baked light, and returns it; one of the same name is made anew and stays in its materials.

    Light is that of the colour attribute Halflight, or of a lightmap (a bpy.types.Image) at the UV map Halflight UV. `Radiance` is
    base colour x (1 - metallic) x irradiance / pi, in W/(m^2 sr); `Shader` emits it, and the material's own emission.
    """
    name = GROUP if image is None else f"{GROUP}: {image.name}"
    group = bpy.data.node_groups.get(name) or bpy.data.node_groups.new(name, "ShaderNodeTree")
    # Users find it in Add > Group, and it stays in the file.
    group.use_fake_user = True
    group.nodes.clear()
    _sockets(group)
    add = group.nodes.new
    link = group.links.new
    entry, leaving = add("NodeGroupInput"), add("NodeGroupOutput")
    if image is None:
        light = add("ShaderNodeAttribute")
        light.attribute_type, light.attribute_name = "GEOMETRY", NAME
    else:
        light, place = add("ShaderNodeTexImage"), add("ShaderNodeUVMap")
        light.image, light.extension, place.uv_map = image, "EXTEND", UV_NAME
        link(place.outputs["UV"], light.inputs["Vector"])
    diffuse = add("ShaderNodeMath")
    diffuse.operation = "SUBTRACT"
    diffuse.inputs[0].default_value = 1
    link(entry.outputs["Metallic"], diffuse.inputs[1])
    albedo = _vector_math(group, "SCALE", entry.outputs["Base Color"], scale=diffuse.outputs[0])
    product = _vector_math(group, "MULTIPLY", albedo, light.outputs["Color"])
    radiance = _vector_math(group, "SCALE", product, scale=1 / math.pi)
    reflected, own, both = add("ShaderNodeEmission"), add("ShaderNodeEmission"), add("ShaderNodeAddShader")
    link(radiance, reflected.inputs["Color"])
    link(entry.outputs["Emission Color"], own.inputs["Color"])
    link(entry.outputs["Emission Strength"], own.inputs["Strength"])
    link(reflected.outputs[0], both.inputs[0])
    link(own.outputs[0], both.inputs[1])
    clear, mixed = add("ShaderNodeBsdfTransparent"), add("ShaderNodeMixShader")
    link(entry.outputs["Alpha"], mixed.inputs[0])
    link(clear.outputs[0], mixed.inputs[1])
    link(both.outputs[0], mixed.inputs[2])
    link(mixed.outputs[0], leaving.inputs["Shader"])
    link(radiance, leaving.inputs["Radiance"])
    link(light.outputs["Color"], leaving.inputs["Irradiance"])
    for index, node in enumerate(group.nodes):
        node.location = (180 * (index % 6) - 540, -220 * (index // 6))
    return group


def _sockets(group):
    """Adds the sockets that a group lacks: links to those that it has stay."""
    there = {(item.in_out, item.name) for item in group.interface.items_tree}
    for name, kind, value in INPUTS:
        if ("INPUT", name) not in there:
            group.interface.new_socket(name, in_out="INPUT", socket_type=kind).default_value = value
    for name, kind in (("Shader", "NodeSocketShader"), ("Radiance", "NodeSocketColor"), ("Irradiance", "NodeSocketColor")):
        if ("OUTPUT", name) not in there:
            group.interface.new_socket(name, in_out="OUTPUT", socket_type=kind)


def _vector_math(group, operation, first, second=None, scale=None):
    node = group.nodes.new("ShaderNodeVectorMath")
    node.operation = operation
    group.links.new(first, node.inputs[0])
    if second is not None:
        group.links.new(second, node.inputs[1])
    if isinstance(scale, float):
        node.inputs["Scale"].default_value = scale
    elif scale is not None:
        group.links.new(scale, node.inputs["Scale"])
    return node.outputs["Vector"]


def show_light(owner, group, copies):
    """Shows baked light on an object: each slot gets a copy of its material that ends in the group, linked to the object.

    Materials and the mesh's own slots stay. `copies` has the copies made so far in this bake, by material and group. Returns notes on
    materials that are left as they are.
    """
    notes = []
    for slot in owner.material_slots:
        if slot.material is None:
            notes.append(f"{owner.name}: a slot without a material does not show the light")
            continue
        original = slot.material.get(ORIGINAL) or slot.material
        if (original, group) not in copies:
            copies[original, group] = _copy(original, group)
        if copies[original, group] is None:
            notes.append(f"material {original.name} does not show the light: it does not end in a Principled BSDF")
            continue
        slot.link = "OBJECT"
        slot.material = copies[original, group]
    return notes


def hide_light(owner):
    """Gives the slots of an object the materials back that [show_light] made copies of."""
    for index, slot in enumerate(owner.material_slots):
        original = slot.material.get(ORIGINAL) if slot.material else None
        if original is not None:
            slot.material = original
            if owner.data.materials[index] == original:
                slot.link = "DATA"


def _copy(original, group):
    """Returns a new copy of a material that shows the group's light in place of an older copy, or None."""
    tree = original.node_tree if original.use_nodes else None
    output = tree.get_output_node("ALL") if tree else None
    links = output.inputs["Surface"].links if output else ()
    if not links or links[0].from_node.type != "BSDF_PRINCIPLED":
        return None
    copy = original.copy()
    tree = copy.node_tree
    output = tree.get_output_node("ALL")
    surface = output.inputs["Surface"].links[0].from_node
    shown = tree.nodes.new("ShaderNodeGroup")
    shown.node_tree, shown.location = group, (surface.location.x, surface.location.y + 240)
    for name, _, _ in INPUTS:
        source = surface.inputs[name]
        if source.is_linked:
            tree.links.new(source.links[0].from_socket, shown.inputs[name])
        else:
            shown.inputs[name].default_value = source.default_value
    tree.links.new(shown.outputs["Shader"], output.inputs["Surface"])
    for other in list(bpy.data.materials):
        if other.get(ORIGINAL) == original and _uses(other, group):
            other.user_remap(copy)
            bpy.data.materials.remove(other)
    copy.name, copy[ORIGINAL] = f"{original.name} {NAME}", original
    return copy


def _uses(material, group):
    return any(node.type == "GROUP" and node.node_tree == group for node in material.node_tree.nodes)
