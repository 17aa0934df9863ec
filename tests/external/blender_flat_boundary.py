"""Run inside Blender 3.4, headless: shows where a flat VDB file's volume ends, as the isosurface that the Volume to Mesh modifier makes.

    blender -b --factory-startup --python-exit-code 1 --python blender_flat_boundary.py -- flat.vdb picture.png grid threshold
            [x y z distance]

At a threshold between the background and the smallest value of the field the surface is the edge of the stored voxels: it is as smooth as the
mesh's boundary where they reach it everywhere, and has dents and steps where they don't. The camera looks at (x, y, z) from `distance` away;
without them at the whole volume. Two pictures of the same arguments can be laid beside each other.
"""

import math
import sys

import bpy
from mathutils import Vector

DIRECTION = Vector((1.0, -1.6, 0.75)).normalized()


def open_volume(path):
    bpy.ops.object.volume_import(filepath=path, align="WORLD", location=(0, 0, 0))
    volume = bpy.context.object
    if not volume.data.grids.load():
        sys.exit(f"{path}: Blender can't load it: {volume.data.grids.error_message}")
    return volume


def isosurface(volume, grid, threshold):
    """An object whose mesh is the isosurface."""
    if grid not in [g.name for g in volume.data.grids]:
        sys.exit(f"there is no grid {grid}")
    surface = bpy.data.objects.new("surface", bpy.data.meshes.new("surface"))
    bpy.context.scene.collection.objects.link(surface)
    modifier = surface.modifiers.new("surface", "VOLUME_TO_MESH")
    modifier.object = volume
    modifier.grid_name = grid
    modifier.threshold = threshold
    modifier.resolution_mode = "GRID"
    clay = bpy.data.materials.new("clay")
    clay.use_nodes = True
    nodes = clay.node_tree.nodes
    nodes.clear()
    shader, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Color"].default_value = (0.75, 0.72, 0.68, 1)
    clay.node_tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    surface.data.materials.append(clay)
    return surface


def look(target, distance):
    data = bpy.data.cameras.new("camera")
    data.clip_end = 100 * distance
    data.clip_start = 0.001 * distance
    camera = bpy.data.objects.new("camera", data)
    camera.location = target + DIRECTION * distance
    camera.rotation_euler = (-DIRECTION).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 4
    # Light that grazes the surface shows its steps.
    sun.rotation_euler = (math.radians(70), 0, math.radians(100))
    bpy.context.scene.collection.objects.link(sun)


def render(picture):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 32
    scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = 700
    scene.render.filepath = picture
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.15, 0.17, 0.2, 1)
    scene.view_settings.view_transform = "Standard"
    scene.world = world
    bpy.ops.render.render(write_still=True)


def main():
    path, picture, grid, threshold, *camera = sys.argv[sys.argv.index("--") + 1 :]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    volume = open_volume(path)
    surface = isosurface(volume, grid, float(threshold))
    volume.hide_render = True
    corners = [Vector(c) for c in volume.bound_box]
    made = surface.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    area = sum(polygon.area for polygon in made.polygons)
    print(f"{path}: {grid} at {threshold}: {len(made.vertices)} vertices, area {area:.6g} square units")
    if camera:
        look(Vector([float(c) for c in camera[:3]]), float(camera[3]))
    else:
        centre = sum(corners, Vector()) / 8
        look(centre, 3.2 * max((c - centre).length for c in corners))
    render(picture)


main()
