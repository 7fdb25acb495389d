"""A lit PLY in an outside reader: python ply.py LIT.ply

Reads it with trimesh and holds what it finds against what must be so: radiosity is reflectance x irradiance + exitance, light
falls on the side where triangles turn counter-clockwise, and the room of kinds.mjs has the size that it has.
"""

import sys

import numpy as np
import trimesh


def check(condition, message):
    if not condition:
        sys.exit(f"failed: {message}")


mesh = trimesh.load(sys.argv[1], process=False)
raw = mesh.metadata["_ply_raw"]
vertices, faces = raw["vertex"]["data"], raw["face"]["data"]


def light(quantity):
    return np.stack([vertices[f"{quantity}_{channel}"].ravel() for channel in ["red", "green", "blue"]], axis=1)


irradiance, radiosity, day = light("irradiance"), light("radiosity"), light("irradiance_day")
check(np.isfinite(irradiance).all() and np.isfinite(radiosity).all(), "a value is not finite")
check(irradiance.min() >= 0 and irradiance.max() > 1.5, f"irradiance from {irradiance.min()} to {irradiance.max()}")
check((day <= irradiance * (1 + 1e-5) + 1e-2 * irradiance.max()).all(), "a group is brighter than all light")
check(np.allclose(mesh.bounds, [[0, 0, 0], [4, 3, 4]], atol=1e-4), f"bounds {mesh.bounds}")
normals = np.stack([vertices[axis].ravel() for axis in ["nx", "ny", "nz"]], axis=1)
first = normals[mesh.faces[:, 0]]
area = mesh.area_faces
check((np.einsum("ij,ij->i", first, mesh.face_normals)[area > 1e-9] > 0.99).all(), "a face is turned")
surface = np.asarray(faces["surface"]).ravel()
check(set(surface) == set(range(surface.max() + 1)), f"surfaces {set(surface)}")
# The ceiling is the only surface of uniform reflectance .7 and no exitance besides others of textures and tints.
ceiling = mesh.faces[(mesh.triangles_center[:, 1] > 2.999)]
ceiling = ceiling[(irradiance[ceiling] > 1e-3).all(axis=2)]
check(len(ceiling) > 100, "the ceiling is dark")
ratio = radiosity[ceiling] / irradiance[ceiling]
check(np.abs(ratio - 0.7).max() < 1e-3, f"reflectance of the ceiling is {ratio.min()} to {ratio.max()}")
print(f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces, irradiance up to {irradiance.max():.3f}")
