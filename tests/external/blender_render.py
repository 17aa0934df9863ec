"""Run inside Blender by blender_render.sh: opens VDB files, lists their grids, renders the first file to a picture.

Arguments after "--": picture.png field min max flat.vdb [other.vdb ...]
"""

import sys

import bpy
from mathutils import Vector


def open_volume(path):
    bpy.ops.object.volume_import(filepath=path, align="WORLD", location=(0, 0, 0))
    volume = bpy.context.object
    grids = volume.data.grids
    if not grids.load():
        sys.exit(f"{path}: Blender can't load it: {grids.error_message}")
    print(f"{path}: {len(grids)} grids")
    for grid in grids:
        print(f"  {grid.name}: {grid.data_type}, {grid.channels} channels")
    return volume


def colour_by(volume, field, low, high):
    """A volume whose emission and density follow one field."""
    material = bpy.data.materials.new("field")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    value = nodes.new("ShaderNodeAttribute")
    value.attribute_name = field
    share = nodes.new("ShaderNodeMapRange")
    share.inputs["From Min"].default_value = low
    share.inputs["From Max"].default_value = high
    ramp = nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color = (0.05, 0.02, 0.3, 1)
    ramp.color_ramp.elements[1].color = (1.0, 0.7, 0.1, 1)
    density = nodes.new("ShaderNodeMath")
    density.operation = "MULTIPLY"
    density.inputs[1].default_value = 14.0 / max(volume.dimensions)
    shader = nodes.new("ShaderNodeVolumePrincipled")
    shader.inputs["Density Attribute"].default_value = ""
    # Emission alone: the picture then depends on the field and not on lights.
    glow = nodes.new("ShaderNodeMath")
    glow.operation = "MULTIPLY"
    glow.inputs[1].default_value = 14.0 / max(volume.dimensions)
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(value.outputs["Fac"], share.inputs["Value"])
    links.new(share.outputs["Result"], ramp.inputs["Fac"])
    links.new(share.outputs["Result"], density.inputs[0])
    links.new(share.outputs["Result"], glow.inputs[0])
    links.new(glow.outputs["Value"], shader.inputs["Emission Strength"])
    shader.inputs["Color"].default_value = (0, 0, 0, 1)
    links.new(ramp.outputs["Color"], shader.inputs["Emission Color"])
    links.new(density.outputs["Value"], shader.inputs["Density"])
    links.new(shader.outputs["Volume"], output.inputs["Volume"])
    volume.data.materials.append(material)


def look_at(volume):
    corners = [volume.matrix_world @ Vector(corner) for corner in volume.bound_box]
    centre = sum(corners, Vector()) / 8
    radius = max((corner - centre).length for corner in corners)
    camera_data = bpy.data.cameras.new("camera")
    camera_data.clip_end = 100 * radius
    camera = bpy.data.objects.new("camera", camera_data)
    camera.location = centre + Vector((1.1, -2.4, 0.9)).normalized() * 3.2 * radius
    camera.rotation_euler = (centre - camera.location).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera


def render(picture):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 16
    scene.cycles.use_denoising = False
    scene.cycles.volume_bounces = 0
    scene.render.resolution_x = 320
    scene.render.resolution_y = 320
    scene.render.filepath = picture
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.03, 0.03, 0.03, 1)
    scene.view_settings.view_transform = "Standard"
    scene.world = world
    bpy.ops.render.render(write_still=True)


def main():
    picture, field, low, high, flat, *others = sys.argv[sys.argv.index("--") + 1 :]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for path in others:
        bpy.data.objects.remove(open_volume(path))
    volume = open_volume(flat)
    if field not in [grid.name for grid in volume.data.grids]:
        sys.exit(f"{flat}: there is no grid {field}")
    colour_by(volume, field, float(low), float(high))
    look_at(volume)
    render(picture)


main()
