"""What addon.py checks, one function each."""

import math
import subprocess
import sys
import time
import types

import addon_room as room
import bpy
import numpy as np

PACKAGE = "bl_ext.user_default.halflight"
LIT = ("floor", "ceiling", "back", "left", "right")
# The quality is preview: 5 % error in relative L2, of the whole room.
BELOW_DIRECT = 0.05
# Root mean square difference over the mean: light at the corners of the floor's faces against the lightmap beside them.
APART = 0.05


def check(condition, message):
    if not condition:
        sys.exit(f"failed: {message}")


def bake(target, **settings):
    """Bakes by the operator, as scripts do; returns the notes."""
    chosen = bpy.context.scene.halflight
    chosen.target = target
    for name, value in settings.items():
        setattr(chosen, name, value)
    started = time.monotonic()
    check(bpy.ops.halflight.bake() == {"FINISHED"}, "the operator did not finish")
    print(f"{target.lower()} baked in {time.monotonic() - started:.1f} s")
    return bpy.context.window_manager.halflight_notes


def snapshot():
    """What a bake must leave as it is, and what it may add, of each object."""
    def of(owner):
        mesh = owner.data
        return {
            "vertices": [tuple(vertex.co) for vertex in mesh.vertices],
            "faces": [tuple(face.vertices) for face in mesh.polygons],
            "materials": [slot.material.name for slot in owner.material_slots],
            "links": [slot.link for slot in owner.material_slots],
            "own materials": [material.name for material in mesh.materials],
            "attributes": sorted(mesh.attributes.keys()),
            "mesh": mesh.name,
        }

    meshes = {owner.name: of(owner) for owner in bpy.data.objects if owner.type == "MESH"}
    counts = {name: len(getattr(bpy.data, name)) for name in ("materials", "images", "node_groups", "meshes", "lights", "objects")}
    return meshes, counts


def is_as_it_was(before, but=()):
    meshes, counts = snapshot()
    for name, owner in before[0].items():
        for key, value in owner.items():
            check(key in but or meshes[name][key] == value, f"the {key} of {name} changed: {value} to {meshes[name][key]}")
    check("counts" in but or counts == before[1], f"something was left behind: {before[1]} became {counts}")


def runs_in_windows():
    """The operator as windows run it, by events: it bakes, and Esc ends it."""
    module = sys.modules[f"{PACKAGE}.operators"]
    methods = {name: value for name, value in vars(module.HALFLIGHT_OT_bake).items() if callable(value)}
    told = []
    begun = type("Begun", (), {**methods, "report": lambda self, kind, text: told.append(text)})()
    context = Context()
    event = {name: types.SimpleNamespace(type=name, value="PRESS") for name in ("TIMER", "ESC", "A")}
    bpy.context.scene.halflight.quality = "FINAL"
    check(begun._begin(context) == {"RUNNING_MODAL"}, f"the operator does not begin: {told}")
    folder = begun._bake.runner.folder
    check(not bpy.ops.halflight.bake.poll(), "a second bake may begin")
    while begun._bake.progress is None:
        check(begun.modal(context, event["TIMER"]) == {"PASS_THROUGH"}, f"the bake ended at once: {told}")
        time.sleep(0.05)
    begun.modal(context, event["TIMER"])
    status = bpy.context.window_manager.halflight_status
    check("%" in status, f"no progress is shown, but {status!r}")
    check(begun.modal(context, event["A"]) == {"PASS_THROUGH"}, "other keys do not reach Blender")
    check(begun.modal(context, event["ESC"]) == {"RUNNING_MODAL"}, "Esc waits for the program, or is not taken")
    while (state := begun.modal(context, event["TIMER"])) == {"PASS_THROUGH"}:
        time.sleep(0.05)
    check(state == {"CANCELLED"} and "cancelled" in told[-1], f"Esc ends in {state}: {told}")
    check(not folder.exists() and bpy.ops.halflight.bake.poll(), "a cancelled bake leaves files, or stops others")
    check(bpy.context.window_manager.halflight_status == "", "a status stays")
    bpy.context.scene.halflight.quality = "PREVIEW"
    before = snapshot()
    check(begun._begin(context) == {"RUNNING_MODAL"}, f"the operator does not begin again: {told}")
    while (state := begun.modal(context, event["TIMER"])) == {"PASS_THROUGH"}:
        time.sleep(0.05)
    check(state == {"FINISHED"} and "5 objects have light, in W/m^2" in told[-1], f"the bake ends in {state}: {told}")
    is_as_it_was(before, but=("attributes", "counts"))


class Context:
    """Blender's context, for an operator that is not one of Blender's."""

    class Manager:
        def __getattr__(self, name):
            return getattr(bpy.context.window_manager, name)

        def __setattr__(self, name, value):
            setattr(bpy.context.window_manager, name, value)

        def modal_handler_add(self, _operator):
            pass

    window_manager = Manager()

    def __getattr__(self, name):
        return getattr(bpy.context, name)


def fails_without_program(preferences):
    program, preferences.program = preferences.program, "/nowhere/coordinator"
    try:
        bpy.ops.halflight.bake()
        check(False, "a program that is not there bakes")
    except RuntimeError as problem:
        check("program `/nowhere/coordinator` not found: install Halflight" in str(problem), f"unclear: {problem}")
    preferences.program = program


def _begun(quality):
    module = sys.modules[f"{PACKAGE}.bake"]
    bpy.context.scene.halflight.quality = quality
    return module.SceneBake(bpy.context, bpy.context.preferences.addons[PACKAGE].preferences)


def cancels():
    """What Esc does: a program in the middle of a bake ends at once, and nothing of it stays."""
    begun = _begun("FINAL")
    while begun.progress is None and not begun.poll():
        time.sleep(0.05)
    check(begun.runner.folder.exists() and not begun.poll(), "the bake was over before it could be cancelled")
    started = time.monotonic()
    begun.cancel()
    check(time.monotonic() - started < 0.5, "cancelling waits for the program")
    check(begun.runner.wait(3), "a cancelled program runs on")
    check(begun.runner.process.returncode == -15, f"the program ended with {begun.runner.process.returncode}")
    begun.close()
    check(not begun.runner.folder.exists(), "the files of a cancelled bake stay")
    bpy.context.scene.halflight.quality = "PREVIEW"


def attribute(owner):
    """The irradiance at the corners of an object's faces: (corners, 3)."""
    colours = bpy.data.objects[owner].data.attributes["Halflight"]
    check((colours.data_type, colours.domain) == ("FLOAT_COLOR", "CORNER"), f"{colours.data_type} at {colours.domain}")
    values = np.empty(4 * len(colours.data), np.float32)
    colours.data.foreach_get("color", values)
    return values.reshape(-1, 4)[:, :3]


def corners(owner):
    """The places of the corners of an object's faces, in the world, and the face of each."""
    mesh = bpy.data.objects[owner].data
    at = np.array([mesh.vertices[loop.vertex_index].co for loop in mesh.loops])
    return at, np.repeat(np.arange(len(mesh.polygons)), [face.loop_total for face in mesh.polygons])


def colours(before):
    notes = bake("ATTRIBUTE")
    is_as_it_was(before, but=("attributes", "counts"))
    check("lamp egg left out: it is an ellipse" in notes, f"the ellipse is not reported: {notes}")
    check("box has no light: it shares its mesh" in notes, f"the shared mesh is not reported: {notes}")
    check("Halflight" not in bpy.data.objects["box"].data.attributes, "a shared mesh has the light of one object")
    for name in LIT:
        light = attribute(name)
        # Below the box it is dark.
        check(np.isfinite(light).all() and light.min() > (-1e-6 if name == "floor" else 0.02), f"{name} is dark at {light.min()}")
        check(bpy.data.objects[name].data["halflight_unit"] == "W/m^2", "the unit is not told")
    at, _ = corners("floor")
    unshaded = (at[:, 0] <= 0) & (at[:, 1] <= -0.5) & (at[:, 0] >= -1.5) & (at[:, 1] >= -1.5)
    straight, found = room.direct(at[unshaded]), attribute("floor")[unshaded].mean(axis=1)
    # Reflected light is less than what the brightest place reflects, seen all around, and the world less than all of it.
    brightest = max(attribute(name).max() for name in LIT)
    most = straight + room.GREY * brightest + math.pi * max(room.WORLD)
    print(f"below the lamps {found.min():.3f} to {found.max():.3f} W/m^2, straight from them {straight.min():.3f} to {straight.max():.3f}")
    check((found > straight * (1 - BELOW_DIRECT)).all() and (found < most).all(), "the light of the floor is out of bounds")
    # The left wall is red: it takes green away from what it is beside.
    beside = attribute("floor")[at[:, 0] == -room.WIDTH / 2].mean(axis=0)
    check(beside[0] > 1.05 * beside[1], f"no red beside the red wall: {beside}")


def coordinates(owner):
    values = np.empty(2 * len(bpy.data.objects[owner].data.loops), np.float32)
    bpy.data.objects[owner].data.uv_layers["Halflight UV"].uv.foreach_get("vector", values)
    return values.reshape(-1, 2)


def pixels(image):
    width, height = image.size
    values = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(height, width, 4)


def sampled(page, at):
    """A page (h, w, 3) at coordinates (n, 2), bilinear."""
    height, width, _ = page.shape
    place = np.clip(at * (width, height) - 0.5, 0, (width - 1.001, height - 1.001))
    low = place.astype(int)
    part = (place - low)[:, :, None]
    (x, y), (u, v) = low.T, (part[:, 0], part[:, 1])
    rows = [page[y + step, x] * (1 - u) + page[y + step, x + 1] * u for step in (0, 1)]
    return rows[0] * (1 - v) + rows[1] * v


def relative(found, expected):
    return float(np.sqrt(((found - expected) ** 2).mean()) / expected.mean())


def lightmap(before):
    bake("LIGHTMAP", size=128, show=True, make_single=True)
    is_as_it_was(before, but=("attributes", "counts", "materials", "links", "mesh"))
    light_agrees("in the lightmap")
    for name in (*LIT, "box", "twin"):
        owner = bpy.data.objects[name]
        check(all(slot.link == "OBJECT" and slot.material.name.endswith(" Halflight") for slot in owner.material_slots), "no copies")
        check(coordinates(name).min() >= 0 and coordinates(name).max() <= 1, f"coordinates of {name} leave the page")
    check(bpy.data.objects["box"].data != bpy.data.objects["twin"].data, "box and twin still share a mesh")


def light_agrees(where):
    """Light at vertices and on the page, on the floor where no shadow of a box begins: a texel is wide, and a face wider."""
    image = bpy.data.images["Halflight Scene 0"]
    check(image.is_float and image.packed_file, "the lightmap is not packed as floats")
    at, faces = corners("floor")
    inside = (np.abs(at) < (room.WIDTH / 2 - 0.1)).all(axis=1)
    for box in ("box", "twin"):
        inside &= np.linalg.norm((at - bpy.data.objects[box].location)[:, :2], axis=1) > 1
    # The page beside the corner, on the side of its face.
    uv = coordinates("floor")
    middle = np.array([uv[faces == face].mean(axis=0) for face in range(faces[-1] + 1)])[faces]
    page = sampled(pixels(image)[..., :3], uv + 0.05 * (middle - uv))
    apart = relative(attribute("floor")[inside], page[inside])
    print(f"light at vertices and {where} are {100 * apart:.2f} % apart on the floor")
    check(apart < APART, "attribute and lightmap do not agree")


def service(preferences, program, folder):
    """The same by a service: pages come as RGBM, and a cancelled bake cancels its job."""
    log = open(folder / "service.log", "wb")
    command = [program, "serve", "--listen", "127.0.0.1:0", "--data", folder / "service"]
    running = subprocess.Popen(command, stdout=log, stderr=log)
    try:
        preferences.where, preferences.address = "SERVICE", listening(folder / "service.log")
        bake("LIGHTMAP", size=128)
        light_agrees("in the lightmap of a service")
        begun = _begun("FINAL")
        while begun.progress is None and not begun.poll():
            time.sleep(0.05)
        begun.cancel()
        check(begun.runner.wait(10), "a cancelled bake of a service goes on")
        begun.close()
        jobs = subprocess.run([program, "jobs", "--server", preferences.address], capture_output=True, text=True, check=True).stdout
        check("cancelled" in jobs.lower(), f"the job goes on: {jobs}")
    finally:
        running.terminate()
        running.wait()
        log.close()
        preferences.where = "LOCAL"
        bpy.context.scene.halflight.quality = "PREVIEW"


def listening(log):
    for _ in range(100):
        for word in log.read_text().split():
            address = word.removeprefix("http://").rstrip("/.,")
            if address.startswith("127.0.0.1:") and not address.endswith(":0"):
                return address
        time.sleep(0.1)
    sys.exit(f"failed: the service does not say where it listens: {log.read_text()}")
