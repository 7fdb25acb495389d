"""The room that addon.py bakes, and figures about it."""

import math

import bpy
import numpy as np

# Metres; open towards -Y, where the camera is and the world shines in.
WIDTH, DEPTH, HEIGHT = 4.0, 4.0, 3.0
WORLD = (0.2, 0.25, 0.3)
GREY = 0.6
BULB, BULB_AT = 60.0, (-0.8, -0.5, 2.2)
PANEL, PANEL_AT, PANEL_SIZE = 40.0, (0.9, 0.6, 2.9), (1.2, 0.5)


def material(name, colour):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.use_backface_culling = True
    surface = made.node_tree.nodes["Principled BSDF"].inputs
    surface["Base Color"].default_value = (*colour, 1)
    surface["Roughness"].default_value = 1
    surface["Specular IOR Level"].default_value = 0
    return made


def grid(name, origin, across, along, cells, of):
    """A rectangle of cells x cells faces from an origin along two sides; it faces across x along."""
    steps = np.linspace(0, 1, cells + 1)
    corners = [np.add(origin, np.multiply(u, across) + np.multiply(v, along)) for v in steps for u in steps]
    row = cells + 1
    faces = [(j * row + i, j * row + i + 1, (j + 1) * row + i + 1, (j + 1) * row + i) for j in range(cells) for i in range(cells)]
    return placed(name, [tuple(map(float, corner)) for corner in corners], faces, of)


def placed(name, corners, faces, of):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(of)
    made = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(made)
    return made


def lamp(name, kind, energy, location, **settings):
    light = bpy.data.lights.new(name, kind)
    light.energy = energy
    for key, value in settings.items():
        setattr(light, key, value)
    made = bpy.data.objects.new(name, light)
    made.location = location
    bpy.context.collection.objects.link(made)
    return made


def world():
    made = bpy.data.worlds.new("world")
    made.use_nodes = True
    bpy.context.scene.world = made
    return made.node_tree


def make():
    """Five sides, a box and its mirrored twin that share a mesh, a point lamp, a turned area lamp, an ellipse, and a world."""
    empty()
    x, y = WIDTH / 2, DEPTH / 2
    grey, red = material("grey", (GREY,) * 3), material("red", (0.6, 0.15, 0.1))
    grid("floor", (-x, -y, 0), (WIDTH, 0, 0), (0, DEPTH, 0), 8, grey)
    grid("ceiling", (-x, y, HEIGHT), (WIDTH, 0, 0), (0, -DEPTH, 0), 1, grey)
    grid("back", (-x, y, 0), (WIDTH, 0, 0), (0, 0, HEIGHT), 3, grey)
    grid("left", (-x, -y, 0), (0, DEPTH, 0), (0, 0, HEIGHT), 3, red)
    grid("right", (x, y, 0), (0, -DEPTH, 0), (0, 0, HEIGHT), 3, grey)
    bpy.ops.mesh.primitive_cube_add(size=0.8, location=(0.9, 0.2, 0.4), rotation=(0, 0, 0.4))
    box = bpy.context.object
    box.name = "box"
    box.data.materials.append(grey)
    twin = bpy.data.objects.new("twin", box.data)
    twin.location, twin.scale = (-1, 1.2, 0.4), (-1, 0.7, 1)
    bpy.context.collection.objects.link(twin)
    lamp("bulb", "POINT", BULB, BULB_AT, shadow_soft_size=0)
    across, along = PANEL_SIZE
    panel = lamp("panel", "AREA", PANEL, PANEL_AT, shape="RECTANGLE", size=across, size_y=along / 2)
    # Turned and stretched: the size is that in the world.
    panel.rotation_euler, panel.scale = (0, 0, math.pi / 2), (1, 2, 1)
    lamp("egg", "AREA", 1, (0, 0, 2), shape="ELLIPSE", size=0.2, size_y=0.1)
    world().nodes["Background"].inputs["Color"].default_value = (*WORLD, 1)
    eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    eye.location, eye.rotation_euler = (0, -6.5, 1.5), (math.pi / 2, 0, 0)
    bpy.context.collection.objects.link(eye)
    bpy.context.scene.camera = eye


def empty():
    for one in list(bpy.data.objects):
        bpy.data.objects.remove(one)
    bpy.ops.outliner.orphans_purge(do_recursive=True)


def direct(points):
    """Irradiance (n,) in W/m^2 straight from the lamps at points (n, 3) of the floor that nothing shades."""
    points = np.asarray(points, float)

    def cosines(source):
        to = np.asarray(source) - points
        square = (to**2).sum(axis=1)
        return to[:, 2] / np.sqrt(square), square

    cosine, square = cosines(BULB_AT)
    result = BULB / (4 * math.pi) * cosine / square
    # Its sides are along Y and X, because it is turned.
    along, across = PANEL_SIZE
    steps = (np.arange(24) + 0.5) / 24 - 0.5
    for u in steps:
        for v in steps:
            cosine, square = cosines((PANEL_AT[0] + u * across, PANEL_AT[1] + v * along, PANEL_AT[2]))
            result += PANEL / math.pi * cosine**2 / square / len(steps) ** 2
    return result
