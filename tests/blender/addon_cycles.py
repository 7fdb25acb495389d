"""What addon.py compares with Cycles: texels, pictures, and a sky."""

import math

import addon_room as room
import bpy
import numpy as np
from addon_checks import attribute, bake, check, pixels, relative

# Of texels of the lightmap and of Cycles' bake: the root mean square of their difference over their mean, which edges of shadows decide,
# and how far the sums of their light are apart.
FROM_CYCLES = 0.08
OF_CYCLES = 0.02
# The same of the sides of a box below an image.
SKY = 0.03
# Mean difference of a picture by the node group from Cycles', of 1, as sRGB shows it; Cycles' has noise.
PICTURE = 0.02


def cycles_bake(owner, target, samples):
    """Cycles' own bake of the diffuse light of an object, into the image of its active node or the active colours: E / pi."""
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", samples
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 16
    scene.cycles.sample_clamp_indirect = 0
    bpy.ops.object.select_all(action="DESELECT")
    owner.select_set(True)
    bpy.context.view_layer.objects.active = owner
    layer = "Halflight UV" if target == "IMAGE_TEXTURES" else ""
    light = {"DIRECT", "INDIRECT"}
    bpy.ops.object.bake(type="DIFFUSE", pass_filter=light, target=target, margin=0, use_clear=True, uv_layer=layer)


def texels():
    """Texel by texel: Cycles bakes the same surfaces on the same coordinates."""
    bpy.ops.halflight.hide()
    bpy.data.objects["egg"].hide_render = True
    ours = bpy.data.images["Halflight Scene 0"]
    image = bpy.data.images.new("cycles", *ours.size, alpha=True, float_buffer=True)
    image.generated_color = (0, 0, 0, 0)
    for name in ("floor", "back", "box", "twin"):
        owner = bpy.data.objects[name]
        nodes = owner.material_slots[0].material.node_tree.nodes
        node = nodes.get("cycles") or nodes.new("ShaderNodeTexImage")
        node.name, node.image, nodes.active = "cycles", image, node
        cycles_bake(owner, "IMAGE_TEXTURES", 256)
        baked = pixels(image)
        # Texels below the boxes are black in Cycles, and filled from beside them in Halflight.
        covered = (baked[..., 3] > 0.99) & (baked[..., :3].max(axis=2) > 0.02)
        truth, found = math.pi * baked[covered][:, :3], pixels(ours)[covered][:, :3]
        apart, of_all = relative(found, truth), float(found.mean() / truth.mean() - 1)
        middle = float(np.median(np.abs(found - truth).mean(axis=1)) / truth.mean())
        texels = f"{covered.sum()} texels, {100 * apart:.2f} % (median {100 * middle:.2f} %) from Cycles"
        print(f"{name}: {texels}, {100 * of_all:+.2f} % of its light")
        if name in ("floor", "back"):
            check(covered.sum() > 500, "Cycles baked too few texels")
            check(apart < FROM_CYCLES and abs(of_all) < OF_CYCLES, f"the light of {name} is not that of Cycles")
    bpy.data.images.remove(image)


def pictures(folder):
    """Pictures of the room by the materials with light, compared with Cycles' picture of lamps and materials; for eyes, too."""
    scene = bpy.context.scene

    def render(name):
        scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 32, False
        scene.view_settings.view_transform = "Standard"
        scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 240, 180, 100
        scene.render.image_settings.file_format = "PNG"
        scene.render.filepath = str(folder / name)
        bpy.ops.render.render(write_still=True)
        return pixels(bpy.data.images.load(scene.render.filepath))[..., :3]

    own = render("cycles.png")
    for target, most in (("ATTRIBUTE", None), ("LIGHTMAP", PICTURE)):
        bake(target)
        shown = render(f"{target.lower()}.png")
        off = np.abs(own - shown).mean()
        print(f"{target.lower()}.png: {off:.4f} of 1 from Cycles' picture in the mean")
        check(most is None or off < most, "the node group does not show the light that Cycles shows")


def sky():
    """A box in the open, lit by an image that is turned: each side has the light that Cycles bakes."""
    room.empty()
    bpy.ops.mesh.primitive_cube_add(size=1)
    box = bpy.context.object
    box.name = "alone"
    box.data.materials.append(room.material("grey", (0.5, 0.5, 0.5)))
    tree = room.world()
    image = bpy.data.images.new("sky", 64, 32, float_buffer=True)
    colours = np.full((32, 64, 4), 1, np.float32)
    colours[..., :3] = 0.1
    # A red and a blue patch to the right of the middle, high and low.
    colours[20:26, 38:46, :3], colours[10:14, 50:56, :3] = (8, 2, 1), (1, 2, 12)
    image.pixels.foreach_set(colours.ravel())
    texture, mapping, place = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Mapping", "TexCoord"))
    texture.image = image
    mapping.inputs["Rotation"].default_value = (0, 0, 0.7)
    tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    tree.nodes["Background"].inputs["Strength"].default_value = 1.5
    bake("ATTRIBUTE", show=False)
    colours = box.data.color_attributes.new(name="cycles", type="FLOAT_COLOR", domain="CORNER")
    box.data.color_attributes.active_color = colours
    cycles_bake(box, "VERTEX_COLORS", 1024)
    truth = np.empty(4 * len(box.data.loops), np.float32)
    box.data.attributes["cycles"].data.foreach_get("color", truth)
    sides = [math.pi * truth.reshape(-1, 4, 4)[..., :3].mean(axis=1), attribute("alone").reshape(-1, 4, 3).mean(axis=1)]
    apart = relative(sides[1], sides[0])
    print(f"a box below a turned image: {100 * apart:.2f} % from Cycles")
    check(apart < SKY, f"the image lights other sides: {sides}")
