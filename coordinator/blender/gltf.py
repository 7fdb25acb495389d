"""Binary glTF files as Python objects and numpy arrays. Needs no Blender."""

import json
import struct

import numpy as np

MAGIC, VERSION, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
AREA_LIGHTS = "EXT_lights_area"
LIGHTMAP = "MOZ_lightmap"


class GltfError(ValueError):
    """A file that is no binary glTF, or holds what this reader does not know."""


def read_glb(data):
    """Returns the document (a dict) and the binary chunk (bytes) of a .glb file's bytes."""
    if len(data) < 20 or struct.unpack_from("<II", data) != (MAGIC, VERSION):
        raise GltfError("no binary glTF 2.0 file")
    document, binary, at = None, b"", 12
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        chunk = data[at + 8 : at + 8 + length]
        if kind == JSON_CHUNK:
            document = json.loads(chunk)
        elif kind == BINARY_CHUNK:
            binary = chunk
        at += 8 + length
    if document is None:
        raise GltfError("a binary glTF file without a document")
    return document, binary


def write_glb(document, binary):
    """Returns the bytes of a .glb file with this document and binary chunk."""
    text = json.dumps(document, separators=(",", ":")).encode()
    chunks = b""
    for kind, chunk, pad in ((JSON_CHUNK, text, b" "), (BINARY_CHUNK, binary, b"\0")):
        if chunk:
            chunk += pad * (-len(chunk) % 4)
            chunks += struct.pack("<II", len(chunk), kind) + chunk
    return struct.pack("<III", MAGIC, VERSION, 12 + len(chunks)) + chunks


def accessor(document, binary, index):
    """Returns the values of an accessor: an array of (count,) or (count, width); normalized integers become floats."""
    entry = document["accessors"][index]
    if "sparse" in entry or "bufferView" not in entry:
        raise GltfError(f"accessor {index} is sparse, or has no data")
    kind, width, count = COMPONENTS[entry["componentType"]], WIDTHS[entry["type"]], entry["count"]
    view = document["bufferViews"][entry["bufferView"]]
    start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
    size = np.dtype(kind).itemsize
    stride = view.get("byteStride", size * width)
    strides = (stride, size) if count else None
    values = np.ndarray((count, width), kind, binary, start, strides).copy()
    if entry.get("normalized"):
        values = np.maximum(values / np.iinfo(kind).max, -1)
    return values[:, 0] if width == 1 else values


def image_bytes(document, binary, texture):
    """Returns the encoded image (PNG) of a texture of this index, which must be stored in the file itself."""
    image = document["images"][document["textures"][texture]["source"]]
    if "bufferView" not in image:
        raise GltfError(f"image {image.get('name', texture)} is not stored in the file")
    view = document["bufferViews"][image["bufferView"]]
    start = view.get("byteOffset", 0)
    return binary[start : start + view["byteLength"]]


class Nodes:
    """The nodes of a document's default scene: `worlds` has the matrix (4, 4) from each to the world, by index."""

    def __init__(self, document):
        self.worlds, self._by_name = {}, {}

        def visit(index, parent):
            node = document["nodes"][index]
            self.worlds[index] = parent @ _local(node)
            self._by_name.setdefault((node.get("name"), "mesh" in node), []).append(index)
            for child in node.get("children", []):
                visit(child, self.worlds[index])

        for root in document["scenes"][document.get("scene", 0)].get("nodes", []):
            visit(root, np.eye(4))

    def find(self, name, world, has_mesh=True):
        """Returns the index of the node of an object, or None.

        Several nodes have one name where a collection is shown more than once: the one at the object's own place (`world`, 4 x 4,
        axes of Blender) is meant. Lamps are turned against the axes of the file, so that only their place counts.
        """
        world = world_to_gltf(world)

        def distance(index):
            off = self.worlds[index] - world
            return np.abs(off if has_mesh else off[:, 3]).max()

        best = min(self._by_name.get((name, has_mesh), ()), key=distance, default=None)
        if best is None or distance(best) > 1e-3 * (1 + np.abs(world).max()):
            return None
        return best


def _local(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turned = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])
    matrix = np.eye(4)
    matrix[:3, :3] = turned * np.array(node.get("scale", (1, 1, 1)), float)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def to_gltf(points):
    """Turns points or vectors (n, 3) from Blender's axes (Z up) to glTF's (Y up)."""
    points = np.asarray(points)
    return np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)


def world_to_gltf(matrix):
    """Returns an object's matrix (4, 4) to Blender's world as one between the axes of glTF."""
    axes = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)
    return axes @ np.asarray(matrix, float) @ axes.T


def add_area_lights(document, lights):
    """Adds lamps to nodes of a document, as EXT_lights_area.

    `lights` are pairs of a node's index and a dict: `name`, `type` (`rect` or `disk`), `size` (height or diameter in metres, in the
    world), `aspect` (width over height), `color` (linear RGB) and `intensity` (radiance, W/(m^2 sr)).
    """
    if not lights:
        return
    worlds = Nodes(document).worlds
    entries = document.setdefault("extensions", {}).setdefault(AREA_LIGHTS, {}).setdefault("lights", [])
    used = document.setdefault("extensionsUsed", [])
    if AREA_LIGHTS not in used:
        used.append(AREA_LIGHTS)
    for node, light in lights:
        # The baker multiplies sizes by the largest scale of the node, whichever axis that is.
        scale = np.linalg.norm(worlds[node][:3, :3], axis=0).max()
        entry = {key: light[key] for key in ("name", "type", "color", "intensity")}
        entry["size"] = light["size"] / scale
        if light["type"] == "rect":
            entry["rect"] = {"aspect": light["aspect"]}
        document["nodes"][node].setdefault("extensions", {})[AREA_LIGHTS] = {"light": len(entries)}
        entries.append(entry)


def give_materials(document):
    """Gives primitives without a material the one that Blender shows there: grey of 0.8. That of glTF is a metal, and reflects no light."""
    primitives = [part for mesh in document.get("meshes", []) for part in mesh["primitives"] if "material" not in part]
    if not primitives:
        return
    materials = document.setdefault("materials", [])
    grey = {"baseColorFactor": [0.8, 0.8, 0.8, 1], "metallicFactor": 0}
    materials.append({"name": "no material", "doubleSided": True, "pbrMetallicRoughness": grey})
    for part in primitives:
        part["material"] = len(materials) - 1


def drop_coordinates(document, node, index):
    """Takes a set of texture coordinates, the last, from the mesh of a node."""
    for primitive in document["meshes"][document["nodes"][node]["mesh"]]["primitives"]:
        primitive["attributes"].pop(f"TEXCOORD_{index}", None)


def lit_triangles(document, binary, node, attribute):
    """Returns what a lit file has on the mesh of a node: positions (t, 3, 3) in the node's own axes, values (t, 3, width) of an
    attribute at the corners, and the material (t,) of each triangle, -1 where it has none.

    `attribute` is a name, or a function from the material's index (or None) to a name; primitives without it are left out.
    """
    mesh = document["meshes"][document["nodes"][node]["mesh"]]
    positions, values, materials = [], [], []
    for primitive in mesh["primitives"]:
        material = primitive.get("material")
        name = attribute(material) if callable(attribute) else attribute
        if primitive.get("mode", 4) != 4 or name not in primitive["attributes"]:
            continue
        at = accessor(document, binary, primitive["attributes"]["POSITION"])
        value = accessor(document, binary, primitive["attributes"][name])
        if "indices" in primitive:
            corners = accessor(document, binary, primitive["indices"]).astype(np.int64)
        else:
            corners = np.arange(len(at))
        corners = corners.reshape(-1, 3)
        positions.append(at[corners])
        values.append(value[corners])
        materials.append(np.full(len(corners), -1 if material is None else material))
    if not positions:
        return np.empty((0, 3, 3)), np.empty((0, 3, 0)), np.empty(0, int)
    return np.concatenate(positions), np.concatenate(values), np.concatenate(materials)
