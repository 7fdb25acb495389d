"""What the peers need of glTF: flat-coloured triangles and point lights in, a lit GLB out.

Shares nothing with the program, so that a mistake of its importer would show as a difference."""

import json
import struct
from dataclasses import dataclass

import numpy as np

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
GLTF, JSON, BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942


class Unsupported(Exception):
    """The scene has something that the peers are not driven to do."""


@dataclass
class Surface:
    """A primitive, in the world."""

    name: str
    positions: np.ndarray
    """(vertices, 3), metres."""
    triangles: np.ndarray
    """(triangles, 3), counter-clockwise seen from the lit side."""
    reflectance: np.ndarray
    """RGB."""
    radiance: np.ndarray
    """Emitted, RGB, W/(m^2 sr)."""
    double_sided: bool = False

    def reflects(self):
        return self.reflectance.max() > 0

    def emits(self):
        return self.radiance.max() > 0


@dataclass
class PointLight:
    position: np.ndarray
    intensity: np.ndarray
    """RGB, W/sr."""


@dataclass
class Scene:
    surfaces: list
    lights: list

    def size(self):
        """Largest extent along an axis."""
        return np.ptp(np.concatenate([surface.positions for surface in self.surfaces]), axis=0).max()


@dataclass
class Mesh:
    """A refined surface: one vertex for each position in each plane."""

    surface: Surface
    positions: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray

    def back(self):
        return Mesh(self.surface, self.positions, -self.normals, self.triangles[:, ::-1])

    def pulled_in(self):
        """The vertices, drawn a little towards the middles of their triangles: the corner of a room is not in a wall then."""
        middles = self.positions[self.triangles].mean(axis=1)
        sums, counts = np.zeros_like(self.positions), np.zeros(len(self.positions))
        for corner in range(3):
            np.add.at(sums, self.triangles[:, corner], middles)
            np.add.at(counts, self.triangles[:, corner], 1)
        return self.positions + (sums / counts[:, None] - self.positions) * 2e-3


def read(path):
    """Reads a GLB with its data inside."""
    with open(path, "rb") as file:
        raw = file.read()
    magic, version, _, length, _ = struct.unpack_from("<5I", raw)
    if magic != GLTF or version != 2:
        raise Unsupported(f"{path} is not a glTF 2.0 binary")
    document = json.loads(raw[20 : 20 + length])
    binary = raw[28 + length :]
    scene = Scene([], [])
    punctual = document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])

    def accessor(index):
        described = document["accessors"][index]
        if "sparse" in described or "bufferView" not in described:
            raise Unsupported(f"{path} has sparse accessors")
        view = document["bufferViews"][described["bufferView"]]
        kind, width = np.dtype(COMPONENTS[described["componentType"]]), WIDTHS[described["type"]]
        offset = view.get("byteOffset", 0) + described.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        return np.ndarray((described["count"], width), kind, binary, offset, (stride, kind.itemsize)).copy()

    def primitive(node, matrix, described):
        if described.get("mode", 4) != 4:
            return
        positions = accessor(described["attributes"]["POSITION"]).astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
        if "indices" in described:
            triangles = accessor(described["indices"]).reshape(-1, 3).astype(int)
        else:
            triangles = np.arange(len(positions)).reshape(-1, 3)
        if np.linalg.det(matrix[:3, :3]) < 0:
            triangles = triangles[:, ::-1]
        material = document["materials"][described["material"]] if "material" in described else {}
        diffuse = material.get("pbrMetallicRoughness", {})
        name = node.get("name", "?")
        if "baseColorTexture" in diffuse or "emissiveTexture" in material:
            raise Unsupported(f"{name} has a texture, and the peers are given flat colours")
        strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
        colour = np.array(diffuse.get("baseColorFactor", [1, 1, 1, 1])[:3], float)
        emissive = np.array(material.get("emissiveFactor", [0, 0, 0]), float)
        reflectance = colour * (1 - diffuse.get("metallicFactor", 1))
        surface = Surface(name, positions, triangles, reflectance, emissive * strength, material.get("doubleSided", False))
        if surface.double_sided and surface.emits():
            raise Unsupported(f"{name} emits from both sides, and the peers' lamps from one")
        scene.surfaces.append(surface)

    def visit(index, parent):
        node = document["nodes"][index]
        matrix = parent @ placement(node)
        if "mesh" in node:
            for described in document["meshes"][node["mesh"]]["primitives"]:
                primitive(node, matrix, described)
        light = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
        if light is not None:
            light = punctual[light]
            if light["type"] != "point":
                raise Unsupported(f"{node.get('name', '?')} is a {light['type']} light")
            intensity = np.array(light.get("color", [1, 1, 1]), float) * light.get("intensity", 1)
            scene.lights.append(PointLight(matrix[:3, 3], intensity))
        for child in node.get("children", []):
            visit(child, matrix)

    for index in document["scenes"][document.get("scene", 0)]["nodes"]:
        visit(index, np.eye(4))
    return scene


def placement(node):
    """The transform of a node, as a matrix."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(node.get("scale", (1, 1, 1)), float)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def refine(scene, edge, backs):
    """Halves the longest edges of all triangles that reflect until none is longer than `edge`; with the backs of
    double-sided surfaces or without. Surfaces without an area are left out.

    An edge is halved in its middle on both sides or on neither, whatever the order: there are no T-vertices."""
    fronts = [refine_surface(surface, edge) for surface in scene.surfaces if surface.reflects()]
    fronts = [mesh for mesh in fronts if len(mesh.triangles)]
    return fronts + [mesh.back() for mesh in fronts if backs and mesh.surface.double_sided]


def refine_surface(surface, edge):
    done, corners = [], surface.positions[surface.triangles]
    while len(corners):
        lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        longest = lengths.argmax(axis=1)
        split = lengths.max(axis=1) > edge * (1 + 1e-9)
        done.append(corners[~split])
        rows, longest = np.nonzero(split)[0], longest[split]
        a, b, c = (corners[rows, (longest + step) % 3] for step in range(3))
        middle = (a + b) / 2
        corners = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    corners = np.concatenate(done or [corners])
    # What has no area has no normal.
    corners = corners[np.linalg.norm(doubled_area(corners), axis=1) > 0]
    normals = doubled_area(corners)
    normals = np.repeat(normals / np.linalg.norm(normals, axis=1, keepdims=True), 3, axis=0)
    points = corners.reshape(-1, 3)
    alike = np.concatenate([points.round(6), normals.round(3)], axis=1)
    _, first, triangles = np.unique(alike, axis=0, return_index=True, return_inverse=True)
    return Mesh(surface, points[first], normals[first], triangles.reshape(-1, 3))


def doubled_area(corners):
    """Twice the area of triangles, along their normals."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def write_lit(path, meshes, irradiances):
    """Writes meshes with an irradiance (W/m^2, RGB) at each vertex as a GLB that `coordinator compare` takes."""
    binary, views, accessors = bytearray(), [], []

    def accessor(values, kind):
        values = np.ascontiguousarray(values)
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes})
        binary.extend(values.tobytes())
        component = 5126 if values.dtype == np.float32 else 5125
        described = {"bufferView": len(views) - 1, "componentType": component, "count": len(values), "type": kind}
        if kind == "VEC3":
            described |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        accessors.append(described)
        return len(accessors) - 1

    described = []
    for mesh, irradiance in zip(meshes, irradiances):
        attributes = {
            "POSITION": accessor(mesh.positions.astype(np.float32), "VEC3"),
            "_IRRADIANCE": accessor(irradiance.astype(np.float32), "VEC3"),
        }
        indices = accessor(mesh.triangles.ravel().astype(np.uint32), "SCALAR")
        described.append({"primitives": [{"attributes": attributes, "indices": indices}]})
    names = [mesh.surface.name for mesh in meshes]
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "nodes": [{"name": name, "mesh": index} for index, name in enumerate(names)],
        "meshes": described,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    with open(path, "wb") as file:
        file.write(struct.pack("<5I", GLTF, 2, 28 + len(text) + len(binary), len(text), JSON) + text)
        file.write(struct.pack("<2I", len(binary), BINARY) + bytes(binary))
