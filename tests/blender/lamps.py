"""Lamps of Blender: python lamps.py COORDINATOR FOLDER

Makes a room with lamps, glow and a world in Blender, exports it in both lighting modes, bakes both files with the unit of their mode,
and compares pictures of them, pixel by pixel in W/(m^2 sr), with what Cycles makes of the room itself. Needs bpy and flip-evaluator (PyPI).
"""

import subprocess
import sys
from pathlib import Path

import bpy
import flip_evaluator
import numpy as np
from addon_room import material

SIZE = (240, 180)
WORLD = (0.2, 0.25, 0.3)
MODES = {"SPEC": "blender", "COMPAT": "blender-unitless"}

# Cycles has noise at this number of samples.
SAMPLES = 256
MOST_FLIP = 0.05
# Of the sum of all pixels: a wrong unit is off by 683, a lost factor of 4 or pi by more than this.
MOST_OFF = 0.03


def check(condition, message):
    if not condition:
        sys.exit(f"failed: {message}")


def glowing(name, strength):
    made = material(name, (0, 0, 0))
    surface = made.node_tree.nodes["Principled BSDF"].inputs
    surface["Emission Color"].default_value = (1, 0.9, 0.8, 1)
    surface["Emission Strength"].default_value = strength
    return made


def quad(name, corners, of):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [tuple(range(len(corners)))])
    mesh.materials.append(of)
    bpy.context.collection.objects.link(bpy.data.objects.new(name, mesh))


def lamp(name, kind, energy, location, rotation=(0, 0, 0)):
    light = bpy.data.lights.new(name, kind)
    light.energy = energy
    if kind == "SUN":
        light.angle = 0
    else:
        light.shadow_soft_size = 0.01
    if kind == "SPOT":
        # Cycles fades the edge by another curve than glTF's.
        light.spot_size, light.spot_blend = 1.2, 0
    placed = bpy.data.objects.new(name, light)
    placed.location, placed.rotation_euler = location, rotation
    bpy.context.collection.objects.link(placed)


def room():
    """Five sides of a room of 4 x 4 x 3 metres, open to the camera, with a box and a glowing plane."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    white, red, blue = (material(name, colour) for name, colour in
                        [("white", (0.7, 0.7, 0.7)), ("red", (0.6, 0.1, 0.1)), ("blue", (0.1, 0.2, 0.6))])
    quad("floor", [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], white)
    quad("ceiling", [(-2, 2, 3), (2, 2, 3), (2, -2, 3), (-2, -2, 3)], white)
    quad("back", [(-2, 2, 0), (2, 2, 0), (2, 2, 3), (-2, 2, 3)], white)
    quad("left", [(-2, -2, 0), (-2, 2, 0), (-2, 2, 3), (-2, -2, 3)], red)
    quad("right", [(2, 2, 0), (2, -2, 0), (2, -2, 3), (2, 2, 3)], blue)
    # Close to the wall: in Cycles a plane glows backwards, too.
    quad("glow", [(-1.5, 1.998, 1), (-0.5, 1.998, 1), (-0.5, 1.998, 2), (-1.5, 1.998, 2)], glowing("glow", 3))
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0.6, 0.4, 0.5), rotation=(0, 0, 0.4))
    bpy.context.object.data.materials.append(white)
    lamp("bulb", "POINT", 60, (-0.8, -0.5, 2.2))
    lamp("spot", "SPOT", 200, (1.2, -1, 2.6), (0.3, 0.2, 0))
    lamp("sun", "SUN", 2, (0, -6, 4), (1.1, 0, -0.25))
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (*WORLD, 1)
    bpy.context.scene.world = world
    eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    eye.location, eye.rotation_euler = (0, -6.2, 1.5), (np.pi / 2, 0, 0)
    bpy.context.collection.objects.link(eye)
    scene = bpy.context.scene
    scene.camera = eye
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100


def pixels(file):
    """Radiance from an EXR file, the first row on top."""
    image = bpy.data.images.load(str(file))
    width, height = image.size
    return np.array(image.pixels[:], dtype=np.float32).reshape(height, width, -1)[::-1, :, :3]


def render(file):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 16
    scene.cycles.sample_clamp_indirect = 0
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    return pixels(file)


def shown(radiance, exposure):
    value = np.clip(radiance * exposure, 0, 1)
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055).astype(np.float32)


def save(name, picture):
    height, width, _ = picture.shape
    image = bpy.data.images.new(name.stem, width, height)
    image.pixels[:] = np.dstack([picture[::-1], np.ones((height, width), np.float32)]).ravel()
    image.filepath_raw, image.file_format = str(name), "PNG"
    image.save()


def main():
    program, folder = Path(sys.argv[1]).absolute(), Path(sys.argv[2]).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    room()
    truth = render(folder / "cycles.exr")
    exposure = 1 / np.quantile(truth, 0.95)
    save(folder / "cycles.png", shown(truth, exposure))
    for mode, unit in MODES.items():
        exported, lit, picture = (folder / f"{mode.lower()}{end}" for end in (".glb", "-lit.glb", ".exr"))
        bpy.ops.export_scene.gltf(filepath=str(exported), export_lights=True, export_cameras=True,
                                  export_import_convert_lighting_mode=mode)
        sky = ",".join(map(str, WORLD))
        subprocess.run([program, "solve", exported, "-o", lit, "--error", "0.02", "--sky", sky, "--light-unit", unit], check=True)
        subprocess.run([program, "render", lit, "-o", picture, "--width", str(SIZE[0]), "--samples", "64"], check=True)
        found = pixels(picture)
        # Outside of the room the one shows the world, the other nothing.
        inside = found.sum(axis=2) > 0
        off = found[inside].sum() / truth[inside].sum() - 1
        blank = np.where(inside[..., None], truth, 0)
        save(folder / f"{mode.lower()}.png", shown(found, exposure))
        _, flip, _ = flip_evaluator.evaluate(shown(blank, exposure), shown(found, exposure), "LDR", inputsRGB=True)
        print(f"{mode}: --light-unit {unit}: {100 * off:+.2f} % of the light, FLIP {flip:.4f}")
        check(abs(off) <= MOST_OFF, "lamps, glow and world do not have one unit")
        check(flip <= MOST_FLIP, "the lit file does not look as Cycles shows the room")


main()
