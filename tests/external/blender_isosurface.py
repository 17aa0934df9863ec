#!/usr/bin/env python3
"""Measures in Blender (3.4, headless) how far a file of `tessera resample --for blender` is from its mesh, in voxels.

usage: blender_isosurface.py --tessera PROGRAM [options of resample, in place of --for blender]

Makes a cube with linear fields, resamples it, opens the file in Blender and compares with the true planes
- isosurfaces that the Volume to Mesh modifier makes, of a field with an oblique gradient and of x, y and z;
- where Cycles shows the volumes of x, y and z to begin.
Exit code 1 when a deviation is above 0.01 voxels (0.02 for Cycles, whose pixels are 1/200 of a voxel), 77 without Blender.
"""

import argparse
import pathlib
import shutil
import subprocess
import sys
import tempfile

CELLS = 4
SPACING = 0.05
PLANES = {"oblique": ((1.0, 0.5, 0.25), 0.88), "x": ((1, 0, 0), 0.513), "y": ((0, 1, 0), 0.477), "z": ((0, 0, 1), 0.538)}
SURFACE_BOUND, PICTURE_BOUND = 0.01, 0.02


def cube_text():
    """A cube of hexahedra with edges of 1 and a field for each plane, as .vtu."""
    steps = range(CELLS + 1)
    points = [(x / CELLS, y / CELLS, z / CELLS) for z in steps for y in steps for x in steps]
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = [
        [(x + a) + (CELLS + 1) * ((y + b) + (CELLS + 1) * (z + c)) for a, b, c in corners]
        for z in range(CELLS) for y in range(CELLS) for x in range(CELLS)
    ]

    def array(name, values, kind="Float64", components=1):
        text = " ".join(map(repr, values))
        return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="ascii">{text}</DataArray>'

    fields = "".join(array(name, [sum(a * b for a, b in zip(normal, p)) for p in points]) for name, (normal, _) in PLANES.items())
    return (
        '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>'
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}"><PointData>{fields}</PointData>'
        f'<Points>{array("places", [c for p in points for c in p], components=3)}</Points>'
        f'<Cells>{array("connectivity", [n for cell in cells for n in cell], "Int64")}'
        f'{array("offsets", [8 * (i + 1) for i in range(len(cells))], "Int64")}{array("types", [12] * len(cells), "UInt8")}</Cells>'
        "</Piece></UnstructuredGrid></VTKFile>"
    )


def drive():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", required=True)
    arguments, options = parser.parse_known_args()
    if not shutil.which("blender"):
        print("blender isn't installed: apt-get install --no-install-recommends blender", file=sys.stderr)
        return 77
    with tempfile.TemporaryDirectory() as folder:
        mesh, volume = pathlib.Path(folder) / "cube.vtu", pathlib.Path(folder) / "cube.vdb"
        mesh.write_text(cube_text())
        # Own names, so that --for gives none.
        fields = ",".join(f"{name}={name}" for name in PLANES)
        command = [arguments.tessera, "resample", mesh, "-o", volume, "--refine", "uniform", "--spacing", str(SPACING), "--field", fields, "--quiet"]
        subprocess.run([*map(str, command), *(options or ["--for", "blender"])], check=True)
        blender = ["blender", "--background", "--factory-startup", "--python-exit-code", "1", "--python", __file__, "--", volume, folder]
        return subprocess.run(list(map(str, blender)), check=False).returncode


def measure(volume_path, folder):
    """Runs inside Blender."""
    import bpy
    from mathutils import Matrix, Vector

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.object.volume_import(filepath=volume_path, align="WORLD", location=(0, 0, 0))
    volume = bpy.context.object
    if not volume.data.grids.load():
        sys.exit(f"{volume_path}: Blender can't load it: {volume.data.grids.error_message}")
    scene = bpy.context.scene

    def isosurface_deviations(name, normal, value):
        """Signed distances of the surface's vertices from the plane, in voxels, those near the cube's faces left out."""
        surface = bpy.data.objects.new("surface", bpy.data.meshes.new("surface"))
        scene.collection.objects.link(surface)
        modifier = surface.modifiers.new("surface", "VOLUME_TO_MESH")
        modifier.object, modifier.grid_name, modifier.threshold, modifier.resolution_mode = volume, name, value, "GRID"
        mesh = surface.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        normal = Vector(normal)
        places = [surface.matrix_world @ vertex.co for vertex in mesh.vertices]
        inside = [p for p in places if all(3 * SPACING < c < 1 - 3 * SPACING for c in p)]
        bpy.data.objects.remove(surface)
        return [(normal.dot(p) - value) / normal.length / SPACING for p in inside]

    def show_above(name, value):
        """The volume glows evenly where the field is above the value."""
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        nodes, links = material.node_tree.nodes, material.node_tree.links
        nodes.clear()
        field, above = nodes.new("ShaderNodeAttribute"), nodes.new("ShaderNodeMath")
        glow, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
        field.attribute_name = name
        above.operation = "GREATER_THAN"
        above.inputs[1].default_value = value
        links.new(field.outputs["Fac"], above.inputs[0])
        links.new(above.outputs["Value"], glow.inputs["Strength"])
        links.new(glow.outputs["Emission"], output.inputs["Volume"])
        volume.data.materials.clear()
        volume.data.materials.append(material)

    def picture_deviation(axis, value, pixels=800, voxels=4):
        """Where the glow begins along an axis in a picture around the plane, minus the plane's place, in voxels."""
        right, back = Vector(), Vector()
        right[axis], back[(axis + 1) % 3] = 1, 1
        middle = Vector((0.5, 0.5, 0.5))
        middle[axis] = value
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        camera.data.type, camera.data.ortho_scale = "ORTHO", voxels * SPACING
        turn = Matrix((right, back.cross(right), back)).transposed().to_4x4()
        camera.matrix_world = Matrix.Translation(middle + 5 * back) @ turn
        scene.collection.objects.link(camera)
        scene.camera = camera
        scene.render.engine = "CYCLES"
        scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", 16, False
        scene.cycles.pixel_filter_type, scene.cycles.volume_step_rate = "BOX", 0.2
        scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = pixels, 4, 100
        scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
        scene.render.filepath = f"{folder}/axis{axis}.exr"
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        values = list(image.pixels)
        row = [sum(values[4 * (x + pixels * y)] for y in range(4)) for x in range(pixels)]
        # The glow covers the right part: its share of the picture says where it begins, to a part of a pixel.
        brightest = sorted(row)[pixels * 9 // 10]
        share = sum(min(v / brightest, 1) for v in row) / pixels if brightest > 0 else 0
        return (0.5 - share) * voxels

    failed = False
    for name, (normal, value) in PLANES.items():
        deviations = isosurface_deviations(name, normal, value)
        if not deviations:
            sys.exit(f"no isosurface of {name}")
        low, high = min(deviations), max(deviations)
        failed |= max(-low, high) > SURFACE_BOUND
        print(f"isosurface of {name}: {len(deviations)} vertices, {low:+.5f} to {high:+.5f} voxels from the plane")
    for axis, name in enumerate("xyz"):
        show_above(name, PLANES[name][1])
        deviation = picture_deviation(axis, PLANES[name][1])
        failed |= abs(deviation) > PICTURE_BOUND
        print(f"Cycles shows {name} from {deviation:+.4f} voxels beside the plane")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    if "--" in sys.argv and "blender" in pathlib.Path(sys.argv[0]).name:
        measure(*sys.argv[sys.argv.index("--") + 1 :])
    else:
        sys.exit(drive())
