"""Blender Cycles: its diffuse bake to vertex colours, on a uniformly refined mesh. Driven by `compare`.

Needs pip's `bpy`, which wants a Python of its own version: give that with --cycles-python."""

import os

import numpy as np

import scene as scenes
import serving


def start():
    import bpy

    return f"Cycles (Blender {bpy.app.version_string})"


def prepare(samples):
    """An empty scene with the settings of a bake."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", os.cpu_count()
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.max_bounces = cycles.diffuse_bounces = 64
    cycles.sample_clamp_indirect = cycles.sample_clamp_direct = 0
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    scene.world = bpy.data.worlds.new("dark")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[1].default_value = 0
    bake = scene.render.bake
    bake.target = "VERTEX_COLORS"
    bake.use_pass_direct = bake.use_pass_indirect = True
    bake.use_pass_color = False
    bake.use_selected_to_active = False
    return scene


def material(surface):
    import bpy

    made = bpy.data.materials.new(surface.name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    output, diffuse = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs[0].default_value = [*map(float, surface.reflectance), 1]
    if not surface.emits():
        links.new(diffuse.outputs[0], output.inputs[0])
        return made
    # A lamp of glTF shines on its front only.
    geometry, mix = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeMixShader")
    emission, strength = nodes.new("ShaderNodeEmission"), float(surface.radiance.max())
    emission.inputs[0].default_value = [*map(float, surface.radiance / strength), 1]
    emission.inputs[1].default_value = strength
    links.new(geometry.outputs["Backfacing"], mix.inputs[0])
    links.new(emission.outputs[0], mix.inputs[1])
    links.new(diffuse.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs[0])
    return made


def add_surface(scene, surface, positions, triangles):
    import bpy

    data = bpy.data.meshes.new(surface.name)
    data.from_pydata(positions.tolist(), [], triangles.tolist())
    data.materials.append(material(surface))
    made = bpy.data.objects.new(surface.name, data)
    scene.collection.objects.link(made)
    return made


def add_light(scene, light):
    import bpy

    data, strength = bpy.data.lights.new("point", "POINT"), float(light.intensity.max())
    data.color, data.energy, data.shadow_soft_size = light.intensity / strength, strength * 4 * np.pi, 0
    made = bpy.data.objects.new("point", data)
    made.location = light.position
    scene.collection.objects.link(made)


def bake(request):
    import bpy

    scene = scenes.read(request["scene"])
    if request["backs"] and any(surface.double_sided for surface in scene.surfaces):
        raise scenes.Unsupported("Cycles bakes one side of a surface")
    meshes = scenes.refine(scene, request["edge"], backs=False)
    baked = prepare(request["samples"])
    for surface in scene.surfaces:
        if not surface.reflects():
            add_surface(baked, surface, surface.positions, surface.triangles)
    for light in scene.lights:
        add_light(baked, light)
    made = [add_surface(baked, mesh.surface, mesh.positions, mesh.triangles) for mesh in meshes]
    for each in made:
        colours = each.data.color_attributes
        colours.active_color = colours.new("bake", "FLOAT_COLOR", "POINT")
        each.select_set(True)
    bpy.context.view_layer.objects.active = made[0]
    clock = serving.Clock()
    bpy.ops.object.bake(type="DIFFUSE")
    times = clock.read()
    irradiances = []
    for each, mesh in zip(made, meshes):
        colours = np.empty(4 * len(mesh.positions), np.float32)
        each.data.color_attributes["bake"].data.foreach_get("color", colours)
        irradiances.append(colours.reshape(-1, 4)[:, :3] * np.pi)
    scenes.write_lit(request["lit"], meshes, irradiances)
    return times | {"vertices": sum(len(mesh.positions) for mesh in meshes)}


if __name__ == "__main__":
    serving.serve(start, bake)
