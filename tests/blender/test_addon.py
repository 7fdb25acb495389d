"""The parts of the add-on that need no Blender: python -m unittest discover tests/blender"""

import json
import math
import stat
import sys
import tempfile
import time
import types
import unittest
from pathlib import Path

import numpy as np

# A package without its __init__.py, which needs Blender.
PACKAGE = types.ModuleType("halflight_addon")
PACKAGE.__path__ = [str(Path(__file__).resolve().parents[2] / "coordinator" / "blender")]
sys.modules[PACKAGE.__name__] = PACKAGE

from halflight_addon import arguments, gltf, lamps, lightmap, matching, progress, runner  # noqa: E402

IDENTITY = np.eye(4)


class Matching(unittest.TestCase):
    SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
    CORNERS = np.array([[0, 1, 2], [0, 2, 3]])

    def lit(self):
        """The square in quarters of its triangles, and its back; the value is x, on the back 9."""
        middle = (self.SQUARE + np.roll(self.SQUARE, -1, axis=1)) / 2
        a, b, c = (self.SQUARE[:, i] for i in range(3))
        x, y, z = (middle[:, i] for i in range(3))
        front = np.concatenate([np.stack(part, axis=1) for part in ([a, x, z], [x, b, y], [z, y, c], [x, y, z])])
        back = self.SQUARE[:, ::-1]
        return np.concatenate([front, back]), np.concatenate([front[..., :1], np.full((2, 3, 1), 9.0)])

    def test_corners_have_the_light_of_their_side(self):
        triangles, values = self.lit()
        found, has_light = matching.values_at_corners(self.SQUARE, self.CORNERS, 4, triangles, values)
        self.assertTrue(has_light.all())
        np.testing.assert_allclose(found[:, 0], [0, 1, 1, 0], atol=2e-3)

    def test_an_edge_of_light_is_seen_from_the_side_of_the_face(self):
        right = self.SQUARE + [1, 0, 0]
        lit, values = np.concatenate([self.SQUARE, right]), np.repeat([[1.0], [5.0]], 6, axis=0).reshape(4, 3, 1)
        found, _ = matching.values_at_corners(right, self.CORNERS, 4, lit, values)
        np.testing.assert_allclose(found[:, 0], 5)

    def test_corners_away_from_the_light_have_none(self):
        triangles, values = self.lit()
        moved = self.SQUARE + [0.6, 0, 0]
        found, has_light = matching.values_at_corners(moved, self.CORNERS, 4, triangles, values)
        self.assertEqual(has_light.tolist(), [True, False, False, True])
        np.testing.assert_allclose(found[:, 0], [0.6, 0, 0, 0.6], atol=2e-3)

    def test_coordinates_are_those_of_the_whole_plane(self):
        triangles, _ = self.lit()
        coordinates = triangles[..., :2] * 0.25 + 0.5
        found, has_any, on = matching.coordinates_at_corners(self.SQUARE, self.CORNERS, 4, triangles, coordinates)
        self.assertTrue(has_any.all() and (on < 8).all())
        np.testing.assert_allclose(found, [[0.5, 0.5], [0.75, 0.5], [0.75, 0.75], [0.5, 0.75]])

    def test_triangles_without_area_take_nothing(self):
        flat = np.zeros((1, 3, 3))
        triangles, values = self.lit()
        _, has_light = matching.values_at_corners(flat, np.array([[0, 1, 2]]), 3, triangles, values)
        self.assertFalse(has_light.any())

    def test_many_points_find_their_triangles(self):
        random = np.random.default_rng(1)
        triangles = random.random((500, 3, 3))
        weights = random.dirichlet((1, 1, 1), 500)
        points = np.einsum("ij,ijk->ik", weights, triangles)
        found = matching.locate(triangles, points, matching.normals(triangles), 1e-9)
        self.assertEqual(found.tolist(), list(range(500)))
        np.testing.assert_allclose(matching.weights(triangles, points), weights, atol=1e-6)


class Gltf(unittest.TestCase):
    def document(self):
        nodes = [{"name": "root", "children": [1], "translation": [0, 0, 5]}, {"name": "panel", "scale": [1, 2, 1]}]
        return {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": nodes}

    def test_files_are_read_as_they_were_written(self):
        data = gltf.write_glb(self.document(), b"\1\2\3")
        self.assertEqual(len(data) % 4, 0)
        document, binary = gltf.read_glb(data)
        self.assertEqual((document, binary), (self.document(), b"\1\2\3\0"))
        for broken in (b"", b"glTF", b"x" * 40, json.dumps(document).encode()):
            with self.assertRaises(gltf.GltfError):
                gltf.read_glb(broken)

    def test_accessors_may_be_interleaved_and_normalized(self):
        binary = np.arange(8, dtype=np.float32).tobytes() + bytes([0, 255])
        document = {
            "bufferViews": [{"byteStride": 16}, {"byteOffset": 32}],
            "accessors": [
                {"bufferView": 0, "byteOffset": 4, "componentType": 5126, "type": "VEC2", "count": 2},
                {"bufferView": 1, "componentType": 5121, "type": "SCALAR", "count": 2, "normalized": True},
            ],
        }
        self.assertEqual(gltf.accessor(document, binary, 0).tolist(), [[1, 2], [5, 6]])
        self.assertEqual(gltf.accessor(document, binary, 1).tolist(), [0, 1])

    def test_area_lights_have_their_size_in_the_world(self):
        document = self.document()
        light = {"name": "p", "type": "rect", "size": 3.0, "aspect": 0.5, "color": [1, 1, 1], "intensity": 7.0}
        gltf.add_area_lights(document, [(1, light), (0, {**light, "type": "disk"})])
        rect, disk = document["extensions"]["EXT_lights_area"]["lights"]
        self.assertEqual((rect["size"], rect["rect"], rect["intensity"]), (1.5, {"aspect": 0.5}, 7.0))
        self.assertEqual((disk["size"], "rect" in disk), (3.0, False))
        self.assertEqual(document["nodes"][1]["extensions"], {"EXT_lights_area": {"light": 0}})
        self.assertEqual(document["extensionsUsed"], ["EXT_lights_area"])

    def test_nodes_of_one_name_differ_by_their_place(self):
        nodes = [{"name": "a", "mesh": 0}, {"name": "a", "mesh": 0, "translation": [2, 0, 0]}, {"name": "a"}]
        document = {"scenes": [{"nodes": [0, 1, 2]}], "nodes": nodes}
        found, place = gltf.Nodes(document), np.eye(4)
        place[0, 3] = 2
        self.assertEqual(found.find("a", place), 1)
        self.assertEqual(found.find("a", IDENTITY, has_mesh=False), 2)
        place[0, 3] = 1
        self.assertIsNone(found.find("a", place))
        self.assertIsNone(found.find("b", IDENTITY))

    def test_what_has_no_material_is_grey(self):
        document = {"meshes": [{"primitives": [{"material": 0}, {}]}], "materials": [{"name": "own"}]}
        gltf.give_materials(document)
        self.assertEqual([part["material"] for part in document["meshes"][0]["primitives"]], [0, 1])
        self.assertEqual(document["materials"][1]["pbrMetallicRoughness"]["metallicFactor"], 0)
        kept = {"meshes": [{"primitives": [{"material": 0}]}]}
        gltf.give_materials(kept)
        self.assertNotIn("materials", kept)

    def test_axes_of_blender_are_turned(self):
        self.assertEqual(gltf.to_gltf([[1, 2, 3]]).tolist(), [[1, 3, -2]])
        matrix = np.eye(4)
        matrix[:3, 3] = (1, 2, 3)
        self.assertEqual(gltf.world_to_gltf(matrix)[:3, 3].tolist(), [1, 3, -2])


class Lightmap(unittest.TestCase):
    def test_places_are_parts_of_pages(self):
        part = {"offset": [0.5, 0.25], "scale": [0.5, 0.25]}
        entry = {"index": 7, "texCoord": 1, "extensions": {"KHR_texture_transform": part}}
        document = {
            "asset": {"extras": {"halflight": {"lightmap": {"textures": [3, 7]}}}},
            "materials": [{}, {"extensions": {"MOZ_lightmap": entry}}],
        }
        self.assertIsNone(lightmap.place(document, 0))
        self.assertIsNone(lightmap.place(document, None))
        place = lightmap.place(document, 1)
        self.assertEqual((place.page, place.attribute), (1, "TEXCOORD_1"))
        np.testing.assert_allclose(lightmap.on_page([[1, 1], [0, 0]], place.transform), [[1, 0.5], [0.5, 0.75]])
        # A positive angle is counter-clockwise, with v down: (1, 0) becomes (0, -1).
        np.testing.assert_allclose(lightmap.on_page([1, 0], {"rotation": math.pi / 2}), [0, 2], atol=1e-12)

    def test_rgbm(self):
        found = lightmap.decode_rgbm(np.array([[[1, 0.5, 0, 0.25]]]), 8)
        self.assertEqual(found.tolist(), [[[2, 1, 0]]])


class Progress(unittest.TestCase):
    LINE = "shoot: unshot 0.39 % · rows 692/1384 · 1264 vertices · 315 rows/s · 31.1 k rays/s · 2 s left"

    def test_lines(self):
        self.assertEqual(str(progress.parse(self.LINE)), "shoot 50 %, 2 s left")
        self.assertEqual(progress.parse("light: unshot 100.00 % · rows 0/9 · 8 vertices"), progress.Progress("light", 0.0))
        self.assertEqual(str(progress.parse("export mesh: 3 s")), "export mesh 0 %")
        self.assertIsNone(progress.parse("warning: shoot"))

    def test_errors_and_warnings(self):
        lamps = ["1 lamp stays in the file, and its", "2 lamps stay in the file, and their"]
        expected = "".join(f"warning: {lamp} light is in the lightmap, too: b\n" for lamp in lamps)
        text = f"{self.LINE}\nwarning: a\n{expected}error: no light;\n  add one\n"
        self.assertEqual(progress.error(text), "no light; add one")
        self.assertEqual(progress.warnings(text), ["a"])
        self.assertEqual(progress.error(f"killed\n{self.LINE}\n"), "killed")
        self.assertEqual(progress.error(""), "")


class Arguments(unittest.TestCase):
    def test_local_bakes(self):
        sky = arguments.Sky(image=Path("sky.hdr"), rotation=-30, intensity=2)
        command = " ".join(arguments.solve("c", "a.glb", "b.glb", arguments.Bake("draft", 512, sky)))
        for part in ("c solve a.glb -o b.glb", "--quality draft", "--light-unit blender", "--lightmap-size 512 --lightmap-format exr"):
            self.assertIn(part, command)
        self.assertIn("--sky sky.hdr --sky-rotation=-30 --sky-intensity 2", command)
        black = arguments.solve("c", "a", "b", arguments.Bake(sky=arguments.Sky(colour=(0, 0, 0))))
        self.assertNotIn("--sky", black)
        self.assertEqual(black[black.index("--materials") + 1], "keep")

    def test_services(self):
        service = arguments.Service("bake:7000", token_file="t")
        bake = arguments.Bake("final", 64, arguments.Sky(colour=(0.1, 0.2, 0.3)))
        command = " ".join(arguments.submit("c", "a.glb", "b.glb", bake, service))
        for part in ("--sky 0.1,0.2,0.3", "--lightmap-format rgbm", "--server bake:7000 --token-file t"):
            self.assertIn(part, command)
        self.assertEqual(arguments.cancel("c", "job", service)[:3], ["c", "cancel", "job"])
        sky = arguments.Sky(image=Path("sky.hdr"), rotation=90)
        command = " ".join(arguments.submit("c", "a", "b", arguments.Bake(sky=sky), service))
        self.assertIn("--sky sky.hdr --sky-rotation=90 --sky-intensity 1", command)
        local = [arguments.Service(address).is_local for address in ("localhost:1", "127.0.0.1:1", "[::1]:1", "bake:1", "128.0.0.1:1")]
        self.assertEqual(local, [True, True, True, False, False])


class Lamps(unittest.TestCase):
    def light(self, **changes):
        settings = dict(
            shape="SQUARE", size=2.0, size_y=1.0, energy=10.0, color=(1, 0.5, 0.25), spread=math.pi, use_shadow=True,
            use_nodes=False, node_tree=None,
        )
        return types.SimpleNamespace(**{**settings, **changes})

    def test_radiance_is_flux_over_pi_and_surface(self):
        for shape, scale, size, aspect, surface in [
            ("SQUARE", (1, 1), 2, 1, 4), ("RECTANGLE", (1, 3), 3, 2 / 3, 6), ("DISK", (0.5, 0.5), 1, 1, math.pi / 4),
            ("ELLIPSE", (1, 2), 2, 1, math.pi),
        ]:
            found, notes = lamps.area("a", self.light(shape=shape), np.diag([*scale, 1, 1]))
            self.assertEqual(notes, [])
            self.assertAlmostEqual(found["size"], size)
            self.assertAlmostEqual(found["aspect"], aspect)
            self.assertAlmostEqual(found["intensity"], 10 / math.pi / surface)
            self.assertEqual(found["type"], "disk" if shape in ("DISK", "ELLIPSE") else "rect")

    def test_newer_settings(self):
        light = self.light(exposure=1.0, normalize=False, use_temperature=True, temperature_color=(1, 1, 0.5))
        found, _ = lamps.area("a", light, IDENTITY)
        self.assertAlmostEqual(found["intensity"], 20 / math.pi)
        self.assertEqual(found["color"], [1, 0.5, 0.125])

    def test_what_is_not_held_is_told(self):
        for changes, scale, text in [
            ({"shape": "ELLIPSE"}, 1, "left out: it is an ellipse"), ({"shape": "DISK"}, 2, "left out: it is an ellipse"),
            ({"size": 0.0}, 1, "no size"), ({"spread": 1.0}, 1, "its spread"), ({"use_shadow": False}, 1, "casts shadows"),
            ({"use_nodes": True, "node_tree": types.SimpleNamespace(nodes=[])}, 1, "left out: of shader nodes"),
        ]:
            found, notes = lamps.area("a", self.light(**changes), np.diag([scale, 1, 1, 1]))
            self.assertIn(text, " ".join(notes))
            self.assertEqual(found is None, "left out" in notes[0])
        portal = self.light(cycles=types.SimpleNamespace(is_portal=True))
        self.assertEqual(lamps.area("a", portal, IDENTITY), (None, []))


class Runner(unittest.TestCase):
    def run_script(self, text, **settings):
        begun = runner.Runner()
        self.addCleanup(begun.close)
        begun.start([sys.executable, "-c", text], **settings)
        return begun

    def test_what_fails_says_why(self):
        begun = self.run_script("import sys; print('warning: w', file=sys.stderr); sys.exit('error: no light; add one')")
        self.assertTrue(begun.wait(10))
        self.assertEqual(begun.warnings(), ["w"])
        with self.assertRaisesRegex(runner.BakeError, "the bake failed: no light; add one"):
            begun.check()
        begun.close()
        self.assertFalse(begun.folder.exists())
        begun.close()

    def test_cancelling_ends_the_program_and_its_job(self):
        done = Path(tempfile.mkdtemp()) / "cancelled"
        told = [sys.executable, "-c", f"import sys; open({str(done)!r}, 'w').write(sys.argv[1])"]
        text = "import sys, time; print('job1', flush=True); print('shoot: rows 1/4', file=sys.stderr, flush=True); time.sleep(60)"
        begun = self.run_script(text, cancel_job=lambda job: [*told, job])
        while begun.progress is None:
            self.assertFalse(begun.poll())
            time.sleep(0.01)
        self.assertEqual(begun.progress.part, 0.25)
        begun.cancel()
        self.assertTrue(begun.wait(10))
        self.assertEqual(begun.process.returncode, -15)
        self.assertEqual(done.read_text(), "job1")

    def test_programs_that_do_not_start(self):
        with self.assertRaisesRegex(runner.BakeError, "`no-such-program` not found: install Halflight"):
            runner.find_program("no-such-program")
        broken = Path(tempfile.mkdtemp()) / "broken"
        broken.write_bytes(b"\0\1\2")
        broken.chmod(broken.stat().st_mode | stat.S_IXUSR)
        begun = runner.Runner()
        self.addCleanup(begun.close)
        with self.assertRaisesRegex(runner.BakeError, "cannot be started"):
            begun.start([runner.find_program(str(broken))])


if __name__ == "__main__":
    unittest.main()
