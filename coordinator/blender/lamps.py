"""Area lamps, which Blender's exporter leaves out, and what a bake does not hold of other lamps."""

import math

# What the exporter writes by itself.
PUNCTUAL = {"POINT", "SPOT", "SUN"}


def area(name, light, matrix):
    """Describes an area lamp for [gltf.add_area_lights].

    `light` is a bpy.types.AreaLight, `matrix` the object's (4, 4) to the world. Returns a dict, or None where the lamp is left out,
    and notes for the user.
    """
    if getattr(getattr(light, "cycles", None), "is_portal", False):
        return None, []
    across, along = (math.sqrt(sum(matrix[row][column] ** 2 for row in range(3))) for column in range(2))
    height = light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size
    width, height = light.size * across, height * along
    is_round = light.shape in ("DISK", "ELLIPSE")
    if is_round and abs(width - height) > 1e-3 * max(width, height):
        return None, [f"lamp {name} left out: it is an ellipse; use a disk or a rectangle"]
    if min(width, height) <= 0:
        return None, [f"lamp {name} left out: it has no size"]
    factor = _node_factor(light)
    if factor is None:
        return None, [f"lamp {name} left out: of shader nodes, only an Emission of one colour and strength is read"]
    surface = width * height * (math.pi / 4 if is_round else 1)
    # Blender's watts are the lamp's whole flux, pi x radiance x surface; without `normalize` they are those of a square metre.
    watts = light.energy * 2 ** getattr(light, "exposure", 0.0)
    radiance = watts / math.pi / (surface if getattr(light, "normalize", True) else 1)
    colour = list(light.color)
    if getattr(light, "use_temperature", False):
        colour = [one * other for one, other in zip(colour, light.temperature_color)]
    found = {
        "name": name,
        "type": "disk" if is_round else "rect",
        "size": height,
        "aspect": width / height,
        "color": [one * other for one, other in zip(colour, factor)],
        "intensity": radiance,
    }
    notes = []
    if light.spread < math.pi - 1e-3:
        notes.append(f"lamp {name}: its spread is not held; it shines as with 180 degrees")
    return found, notes + shadowless(name, light)


def shadowless(name, light):
    """Returns a note where a lamp casts no shadows in Blender: it does in the bake."""
    return [] if light.use_shadow else [f"lamp {name}: casts shadows in the bake"]


def _node_factor(light):
    """Returns the factors (RGB) of the shader nodes of a lamp, or None where they are more than an Emission of fixed values."""
    if not light.use_nodes or light.node_tree is None:
        return (1.0, 1.0, 1.0)
    emission = surface_node(light.node_tree, "OUTPUT_LIGHT")
    if emission is None or emission.type != "EMISSION" or any(entry.is_linked for entry in emission.inputs):
        return None
    strength = emission.inputs["Strength"].default_value
    return tuple(strength * part for part in emission.inputs["Color"].default_value[:3])


def surface_node(tree, output):
    """Returns the node at the Surface of a node tree's active output of this type, or None."""
    for node in tree.nodes:
        if node.type == output and node.is_active_output and node.inputs["Surface"].is_linked:
            return node.inputs["Surface"].links[0].from_node
    return None
