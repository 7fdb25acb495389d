"""Mitsuba 3: path tracing at the vertices of a uniformly refined mesh. Driven by `compare`.

Needs pip's `mitsuba` and an LLVM library, which DRJIT_LIBLLVM_PATH names where it is not found."""

import glob
import os

import numpy as np

import scene as scenes
import serving

PATHS_AT_ONCE = 2_000_000
"""Bounds the memory."""

WARM_UP = 16
"""Samples at each vertex of the first bake of a scene, which compiles it and does not count."""

warmed = {}


def start():
    libraries = glob.glob("/usr/lib/*/libLLVM*.so*") + glob.glob("/usr/lib*/llvm*/lib*/libLLVM*.so*")
    if libraries:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", max(libraries))
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    # Fails here rather than later where there is no LLVM.
    mitsuba.load_dict({"type": "independent"}).seed(0, 4)
    return f"Mitsuba {mitsuba.__version__}"


def build(scene):
    import mitsuba

    def surface(index, surface):
        properties = mitsuba.Properties()
        diffuse = {"type": "diffuse", "reflectance": rgb(surface.reflectance)}
        if surface.double_sided:
            diffuse = {"type": "twosided", "bsdf": diffuse}
        properties["bsdf"] = mitsuba.load_dict(diffuse)
        if surface.emits():
            emitter = {"type": "area", "radiance": rgb(surface.radiance)}
            properties["emitter"] = mitsuba.load_dict(emitter)
        mesh = mitsuba.Mesh(f"m{index}", len(surface.positions), len(surface.triangles), props=properties)
        parameters = mitsuba.traverse(mesh)
        parameters["vertex_positions"] = surface.positions.astype(np.float32).ravel()
        parameters["faces"] = surface.triangles.astype(np.uint32).ravel()
        parameters.update()
        return mesh

    described = {"type": "scene", "integrator": {"type": "path", "max_depth": -1, "rr_depth": 12}}
    for index, light in enumerate(scene.lights):
        position = light.position.tolist()
        described[f"l{index}"] = {"type": "point", "position": position, "intensity": rgb(light.intensity)}
    described |= {f"m{index}": surface(index, each) for index, each in enumerate(scene.surfaces)}
    return mitsuba.load_dict(described)


def rgb(values):
    return {"type": "rgb", "value": [float(value) for value in values]}


def radiances(built, positions, directions, samples):
    """Mean radiance that leaves each position against its direction; RGB."""
    import mitsuba

    totals, left, batch = np.zeros((len(positions), 3)), samples, 0
    while left > 0:
        now = min(left, max(1, PATHS_AT_ONCE // len(positions)))
        origins, towards = np.repeat(positions, now, axis=0), np.repeat(directions, now, axis=0)
        sampler = mitsuba.load_dict({"type": "independent"})
        sampler.seed(7000 + batch, len(origins))
        rays = mitsuba.RayDifferential3f(mitsuba.Point3f(origins.T), mitsuba.Vector3f(towards.T))
        radiance = built.integrator().sample(built, sampler, rays)[0]
        totals += np.array(radiance).reshape(3, len(positions), now).sum(axis=2).T
        left, batch = left - now, batch + 1
    return totals / samples


def irradiance(radiance, surface):
    """Irradiance of points of a surface that send this radiance; 0 in channels that reflect nothing."""
    reflected = np.pi * (radiance - surface.radiance)
    return np.divide(reflected, surface.reflectance, out=np.zeros_like(reflected), where=surface.reflectance > 0)


def bake(request):
    scene = scenes.read(request["scene"])
    meshes = scenes.refine(scene, request["edge"], request["backs"])
    normals = np.concatenate([mesh.normals for mesh in meshes])
    positions = np.concatenate([mesh.pulled_in() for mesh in meshes]) + normals * scene.size() * 2e-5
    if request["scene"] not in warmed:
        warmed[request["scene"]] = build(scene)
        radiances(warmed[request["scene"]], positions, -normals, WARM_UP)
    clock = serving.Clock()
    found = radiances(warmed[request["scene"]], positions, -normals, request["samples"])
    times = clock.read()
    ends = np.cumsum([len(mesh.positions) for mesh in meshes])[:-1]
    irradiances = [
        irradiance(part, mesh.surface)
        for mesh, part in zip(meshes, np.split(found, ends))
    ]
    scenes.write_lit(request["lit"], meshes, irradiances)
    return times | {"vertices": len(positions)}


if __name__ == "__main__":
    serving.serve(start, bake)
