"""A lit GLB of kinds.mjs in Blender: python check.py FILE.glb POINTS.json [PICTURE.png]

Imports the file, looks for names, colours, the attributes of light and what else was to survive, renders it with Cycles on the
processor from the file's camera, and compares pixels with what expected.mjs says. Needs bpy (PyPI) and its numpy.
"""

import json
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

# Largest difference of a channel from what is expected, of 1, as sRGB shows it: Blender keeps vertex colours in 8 bits.
TOLERANCE = 0.012


def srgb(linear):
    value = np.clip(np.asarray(linear, dtype=float), 0, 1)
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)


def check(condition, message):
    if not condition:
        sys.exit(f"failed: {message}")


def import_file(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(path))


def look_at_objects(groups, expected):
    objects = bpy.data.objects
    for name in ["floor", "left", "right", "back", "ceiling", "lamp", "plant", "veil", "radio", "eye", "bulb", "spinner"]:
        check(name in objects, f"no object {name}, only {sorted(objects.keys())}")
    check(objects["radio"]["owner"] == "the tenant", "extras of a node are gone")
    check(bpy.data.materials["checks"]["from"] == "the shop", "extras of a material are gone")
    check(objects["eye"].type == "CAMERA" and objects["bulb"].type == "LIGHT", "camera or light is gone")
    check(any(action.name.startswith("spin") for action in bpy.data.actions), "the animation is gone")
    # Blender does not load what only an unlit material names.
    images = {image.name for image in bpy.data.images}
    check({"checks", "leaves"} <= images, f"images are gone, but for {images}")
    check(len(objects["floor"].data.uv_layers) == 2, "a UV set is gone")
    check("_WEAR" in objects["floor"].data.attributes, "an attribute of the input is gone")
    check("_COLOR_0" in objects["left"].data.attributes, "the input's colours are gone")
    for name in ["floor", "left", "right", "back", "ceiling"]:
        mesh = objects[name].data
        check(len(mesh.color_attributes) == 1, f"{name} has {len(mesh.color_attributes)} colours")
        values = {}
        for attribute in ["_IRRADIANCE"] + groups:
            check(attribute in mesh.attributes, f"{name} lacks {attribute}, has {mesh.attributes.keys()}")
            light = mesh.attributes[attribute]
            check(light.data_type == "FLOAT_VECTOR", f"{attribute} is {light.data_type}")
            flat = np.empty(3 * len(light.data), dtype=np.float32)
            light.data.foreach_get("vector", flat)
            check(np.isfinite(flat).all(), f"{attribute} of {name} is not finite")
            values[attribute] = flat
        # Blender turns vectors of the file into its own axes; their length is the same, and a sum stays a sum.
        if groups:
            total = sum(values[group] for group in groups)
            off = np.abs(total - values["_IRRADIANCE"]).max() / np.abs(values["_IRRADIANCE"]).max()
            check(off < 1e-5, f"groups of {name} are off their sum by {off}")
        brightest = float(np.abs(values["_IRRADIANCE"]).max())
        check(
            abs(brightest - expected[name]) <= 1e-6 * expected[name],
            f"irradiance of {name} ends at {brightest}, not at {expected[name]}: no high dynamic range",
        )
    check(max(expected.values()) > 1, "nothing is brighter than 1, so a high dynamic range is not put to the test")


def render(width, height, out):
    scene = bpy.context.scene
    scene.camera = bpy.data.objects["eye"]
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 4
    scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(out)
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(str(out))
    pixels = np.array(picture.pixels[:]).reshape(height, width, 4)
    return pixels[::-1, :, :3]


def compare(points, pixels):
    worst, wrong = 0.0, 0
    for point in points:
        expected = srgb(point["colour"])
        found = pixels[point["y"], point["x"]]
        off = float(np.abs(expected - found).max())
        worst = max(worst, off)
        if off > TOLERANCE:
            wrong += 1
            if wrong <= 5:
                print(f"{point['node']} at {point['x']},{point['y']}: {found}, not {expected}")
    print(f"{len(points)} points, {wrong} wrong, largest difference {worst:.4f}")
    check(points and wrong == 0, "the picture is not what it should be")


def main():
    file, points = Path(sys.argv[1]), json.loads(Path(sys.argv[2]).read_text())
    out = Path(sys.argv[3]) if len(sys.argv) > 3 else Path(tempfile.mkdtemp()) / "picture.png"
    header = file.read_bytes()
    document = json.loads(header[20 : 20 + int.from_bytes(header[12:16], "little")])
    groups = [group["attribute"] for group in document["asset"]["extras"]["halflight"].get("groups", [])]
    print(f"Blender {bpy.app.version_string}, {file}")
    import_file(file)
    look_at_objects(groups, points["brightest"])
    compare(points["points"], render(points["width"], points["height"], out.absolute()))


main()
