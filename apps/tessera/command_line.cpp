#include "command_line.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <memory>

#include "commands.h"
#include "job/program_presets.h"
#include "option_groups.h"
#include "resample/cut_plane.h"
#include "tessera/error.h"

namespace tessera {

namespace {

CLI::Option* addTimeStep(CLI::App& command, int& step) {
    return command
        .add_option(
            "--time-step", step,
            "files with several steps, .pvd files among them: which one, counted from 0 (default: the "
            "last)")
        ->check(CLI::Range(0, std::numeric_limits<int>::max()));
}

void addRepairOptions(CLI::App& command, RepairArguments& a) {
    const std::string group = "Repair of the mesh";
    auto* repair =
        command
            .add_flag("--repair", a.repair,
                      "collapse degenerate elements (needles, spindles, slivers, caps, flat ones) into their "
                      "neighbours and turn inverted ones; without it the mesh is taken as it is")
            ->group(group);
    command
        .add_option("--repair-aspect", a.aspect,
                    "elements are degenerate whose smallest height over their longest edge is below this "
                    "(default: 1e-6)")
        ->check(numbersWithin(1e-12, 0.5))
        ->needs(repair)
        ->group(group);
    command
        .add_option("--repair-angle", a.angle,
                    "dihedral angles above this, in degrees, are large: their number tells the classes apart "
                    "(default: 150)")
        ->check(numbersWithin(90, 179))
        ->needs(repair)
        ->group(group);
    command
        .add_option("--repair-max-volume-loss", a.maxVolumeLoss,
                    "share of the volume, such as 1e-4 or 0.01%, that removing elements may change "
                    "(default: 1e-6); elements that need more stay, and a warning counts them")
        ->needs(repair)
        ->group(group);
}

/// Leaves --max-memory out where the command has it already.
void addReaderOptions(CLI::App& command, ReaderArguments& a) {
    const std::string group = "How to read the mesh";
    command
        .add_option(
            "--reader", a.kind,
            "isolated: in a process of its own, so that a damaged file can't crash or exhaust this one. "
            "in-process: for debugging")
        ->check(CLI::IsMember({"isolated", "in-process"}))
        ->capture_default_str()
        ->group(group);
    command
        .add_option(
            "--max-read-time", a.maxSeconds,
            "seconds that reading may take (default: 3 of processor time and 60 until the end, and more "
            "for large files); not with --reader in-process")
        ->group(group);
    command
        .add_flag("--follow-links", a.followsLinks,
                  "files may name others anywhere: pieces, steps, external values, links. Else only in the "
                  "folder of the file that is named, and below it")
        ->group(group);
    if (!command.get_option_no_throw("--max-memory"))
        command
            .add_option(
                "--max-memory", a.maxMemory,
                "memory that reading may take, e.g. 4G (default: 640M and 96 times the file's size); not "
                "with --reader in-process")
            ->group(group);
}

void addCommonOptions(CLI::App& command, CommonOptions& options, bool readsMesh = true) {
    addRunOptions(command, options);
    command
        .add_option("--max-driver-time", options.maxDriverSeconds,
                    "seconds in which OpenGL's drivers must show that they work")
        ->check(CLI::Range(0.01, 3600.0))
        ->group("");  // for machines where that takes long, and for tests
    if (readsMesh) addReaderOptions(command, options.reader);
}

/// How to sample, without --algorithm: for commands that run several.
void addBindOptions(CLI::App& command, AlgorithmArguments& a) {
    const std::string group = "How to sample";
    command.add_option("--gl", a.gl, "OpenGL platform (default: the first that can be had)")
        ->check(CLI::IsMember({"egl-device", "egl-surfaceless", "osmesa"}))
        ->group(group);
    command
        .add_option(
            "--sample-format", a.sampleFormat,
            "what an OpenGL resampler keeps values in; r16 and r8 divide the field's range into steps")
        ->check(CLI::IsMember({"r32f", "r16f", "r16", "r8"}))
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--primitives", a.primitives,
                    "who makes what an OpenGL resampler draws or scans: the device, where the mesh fits, or "
                    "the processor, as in the paper; the result doesn't depend on it")
        ->check(CLI::IsMember({"device", "processor"}))
        ->capture_default_str()
        ->group(group);
}

void addAlgorithmOptions(CLI::App& command, AlgorithmArguments& a) {
    const std::string group = "How to sample";
    command
        .add_option("--algorithm", a.name,
                    "the resampler, or auto: the one that is predicted to be fastest, from times measured on "
                    "this machine (results may then differ from machine to machine)")
        ->capture_default_str()
        ->group(group);
    addBindOptions(command, a);
}

void addRefineOptions(CLI::App& command, ResampleArguments& a) {
    const std::string group = "Where to sample how finely";
    a.common.reader.memoryBoundsRun = true;
    command
        .add_option(
            "--refine", a.refine,
            "uniform: one spacing. element-size: spacing follows the local element size. error: refine until "
            "the measured error is within --max-error. focus: fine around --focus. Several, such as "
            "element-size,focus: as fine as any of them wishes; with visibility, only where "
            "--transfer-function shows what differs")
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--resolution", a.resolution,
                    "lattice points along the longest axis, at the finest level")
        ->group(group);
    command.add_option("--spacing", a.spacing, "spacing of the finest level, in world units")->group(group);
    command
        .add_option("--samples-per-element", a.request.refine.samplesPerElement,
                    "element-size: samples along a typical element edge")
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--max-levels", a.maxLevels,
                    "levels of spacing at most, each twice the one below (default: 8; for error no bound)")
        ->group(group);
    command
        .add_option("--max-error", a.maxError,
                    "error: bound in field units, or a share of each field's range such as 1%")
        ->group(group);
    command.add_option("--error-measure", a.errorMeasure, "error: which figure the bound holds for")
        ->check(CLI::IsMember({"max", "rms"}))
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--error-field", a.errorFields,
                    "error: fields a,b that the bound holds for (default: all point fields chosen)")
        ->group(group);
    command
        .add_option(
            "--focus", a.focus,
            "focus: a place x,y,z where bricks have the finest spacing (world units); may be repeated")
        ->group(group);
    command
        .add_option("--transfer-function", a.transferFunction,
                    "visibility: a JSON file of opacities and colours over a field's values")
        ->group(group);
    command
        .add_option("--radius", a.radius,
                    "focus: distance from the place up to which spacing is the finest; beyond, it grows in "
                    "proportion to the distance; once, or for each --focus")
        ->group(group);
    command
        .add_option("--brick-size", a.request.refine.brickCells,
                    "cells along a brick's edge: 8, 16, 32 or 64")
        ->capture_default_str()
        ->group(group);
    command.add_option("--bounds", a.bounds, "sample only inside the box x0,y0,z0,x1,y1,z1 (world units)")
        ->group(group);
    command
        .add_option(
            "--resume", a.request.log,
            "keep sampled bricks in this file, and take those that an earlier run left there: after a "
            "run was killed the same command goes on")
        ->group(group);
    command
        .add_option("--like", a.request.like, "use the lattice (origin and finest spacing) of this .vdb file")
        ->group(group);
    command
        .add_option("--max-voxels", a.maxVoxels,
                    "bound on stored voxels, e.g. 500M (default: from the memory there is)")
        ->group(group);
    command
        .add_option(
            "--max-memory", a.common.reader.maxMemory,
            "bound on the memory for reading, the mesh, its samples and the work on them, e.g. 4G (default: "
            "three quarters of the machine's or the container's); with --reader in-process reading itself "
            "has "
            "no bound")
        ->group(group);
    command
        .add_flag("--dry-run", a.request.dryRun,
                  "print voxels, bytes and predicted time of each layout; write nothing")
        ->group(group);
}

void addOutputOptions(CLI::App& command, ResampleArguments& a) {
    const std::string group = "What to write";
    command.add_option("--field", a.fields, "fields to sample: a,b=newname,... (default: all)")->group(group);
    command
        .add_option(
            "--for", a.request.program,
            "the program that will read the file: sets --layout, --up-axis, --extend and --voxel-shift, "
            "and gives grids the names that it looks for, unless these are given too")
        ->check(CLI::IsMember(programNames()))
        ->group(group);
    command
        .add_option("--layout", a.file.layout,
                    "levels: one grid a field and level (default for .vdb). flat: one grid a field at the "
                    "finest spacing (.nvdb and .vti hold nothing else)")
        ->check(CLI::IsMember({"levels", "flat"}))
        ->group(group);
    command.add_flag("--half", a.request.write.halfFloat, "store values as 16-bit floats")->group(group);
    command
        .add_option("--extend", a.file.extendLayers,
                    "layers of voxels written outside the mesh, with the value at the nearest mesh point "
                    "(default: 1 for "
                    "the flat layout, which Blender and Houdini interpolate without looking at the mesh; 0 "
                    "for levels)")
        ->group(group);
    command
        .add_flag(
            "--brick-statistics", a.request.write.brickStatistics,
            "store each brick's range, histogram and error beside the samples, for programs that choose "
            "bricks by them; for the levels layout")
        ->group(group);
    command
        .add_option(
            "--background", a.background,
            "value of voxels that are not stored (default: 0; in a .vti file, which has them all, a value "
            "of the field)")
        ->group(group);
    command
        .add_option("--unit-scale", a.unitScale,
                    "file units per world unit (default: 1, or a power of ten when voxels are tiny)")
        ->group(group);
    command
        .add_option("--up-axis", a.file.upAxis,
                    "turn the grid so that this axis of the file points up: keep, y or z (default: keep)")
        ->check(CLI::IsMember({"keep", "y", "z"}))
        ->group(group);
    command
        .add_option(
            "--voxel-shift", a.file.voxelShift,
            "share of a voxel by which the file places every voxel beside its sample, along x, y and z, for "
            "programs that draw it elsewhere (default: 0)")
        ->group(group);
    addTimeStep(command, a.request.timeStep)->group(group);
}

/// What standard output gets, which has no ending. The first kind is the default.
void addFormat(CLI::App& command, std::string& format, const std::vector<std::string>& kinds) {
    command
        .add_option("--format", format,
                    fmt::format("with -o -: what to write to standard output (default: {})", kinds.front()))
        ->check(CLI::IsMember(kinds));
}

std::vector<std::string> formatNames() {
    std::vector<std::string> names;
    for (const OutputFormat& format : outputFormats()) names.emplace_back(format.name);
    return names;
}

/// "the file, by its ending: .a (A), .b (B)"
std::string fileKinds() {
    std::string text = "the file; its ending says what it is: ";
    for (const OutputFormat& format : outputFormats())
        text += fmt::format("{}.{} ({})", &format == &outputFormats().front() ? "" : ", ", format.name,
                            format.title);
    return text;
}

void addResampleOptions(CLI::App& command, ResampleArguments& a) {
    command
        .add_option(
            "mesh", a.request.inputs,
            "a mesh file, or the steps of a series: mesh files and patterns such as 'run_*.vtu', taken in "
            "the order of the numbers in their names (run_2 before run_10), or one .pvd file")
        ->required();
    command.add_option("-o,--output", a.request.output,
                       fileKinds() +
                           "; - for standard output. #### or %04d stands for the step's number in a series, "
                           "%% for a percent sign");
    addFormat(command, a.format, formatNames());
    command.add_option("--times", a.times,
                       "only the steps of a .pvd file with times from a to b, both included: a:b, a: or :b");
    addRefineOptions(command, a);
    addOutputOptions(command, a);
    addAlgorithmOptions(command, a.algorithm);
    addRepairOptions(command, a.repair);
    addCommonOptions(command, a.common);
    command.add_flag(
        "--strict", a.common.strict,
        "exit code 3 when a result isn't what was asked for (the error bound missed, a grid coarser "
        "than asked for); everything is written all the same");
    command.footer(R"(Examples:
  tessera resample flow.vtu -o flow.vdb
  tessera resample flow.vtu -o flow.vdb --refine error --max-error 1% --error-field pressure --brick-size 8
  tessera resample flow.vtu -o flow.vdb --refine uniform --resolution 256 --layout flat --half
  tessera resample flow.vtu -o flow.vdb --for blender --refine error --max-error 2%
  tessera resample flow.vtu -o flow.vdb --field velocity=v,pressure=density --max-memory 8G --dry-run
  tessera resample flow.vtu -o flow.vti --field pressure
  tessera resample run_*.vtu -o out_%04d.vdb --json report.json
  tessera resample run.pvd -o 'out_####.vdb' --times 0.5:2)");
}

void addInfoOptions(CLI::App& command, InfoArguments& arguments) {
    command.add_option("file", arguments.request.paths,
                       "a mesh file, a .vdb file that tessera wrote, or a series as resample takes it: mesh "
                       "files, patterns, or one .pvd file");
    command.add_flag("--gl", arguments.request.gl, "what OpenGL this machine has; the file may be left out");
    command.add_flag("--limits", arguments.request.limits,
                     "what the process that reads files is kept from; the file may be left out");
    addTimeStep(command, arguments.request.timeStep);
    addRepairOptions(command, arguments.repair);
    addCommonOptions(command, arguments.common);
    command.footer(
        "Examples:\n  tessera info mesh.vtu\n  tessera info run.pvd\n  tessera info out.vdb --json -\n"
        "  tessera info --gl");
}

void addVerifyOptions(CLI::App& command, VerifyArguments& arguments) {
    command.add_option("mesh", arguments.request.meshPath, "the mesh file that the .vdb file was made from")
        ->required();
    command.add_option("vdb", arguments.request.vdbPath, "the .vdb file")->required();
    addTimeStep(command, arguments.request.timeStep);
    addCommonOptions(command, arguments.common);
    command.footer(
        "Checks every voxel against the mesh, reads the grids as other programs do, measures the error anew "
        "and "
        "compares it with what the file says. Exit code 2 when a claim does not hold.\n"
        "Example:\n  tessera verify mesh.vtu out.vdb");
}

void addTetsOptions(CLI::App& command, TetsArguments& arguments) {
    command.add_option("mesh", arguments.request.input, "mesh file")->required();
    command
        .add_option("-o,--output", arguments.request.output,
                    "the .vtu file of tetrahedra; - for standard output")
        ->required();
    addTimeStep(command, arguments.request.timeStep);
    addRepairOptions(command, arguments.repair);
    addCommonOptions(command, arguments.common);
    command.footer("Example:\n  tessera tets mesh.vtu -o tets.vtu");
}

void addRenderOptions(CLI::App& command, RenderArguments& a) {
    command
        .add_option("input", a.frames.inputs,
                    "a .vdb file that tessera wrote, or a mesh; of several each is one frame")
        ->required();
    command
        .add_option("-o,--output", a.request.output,
                    "the picture: .png, or .exr with light and opacity as floats; - for a .png to standard "
                    "output")
        ->required();
    command.add_option(
        "--scene", a.request.scene,
        "a JSON file with camera, transfer function, clips and more (default: all of the data, "
        "opacities by how rare values are)");
    command.add_option("--field", a.request.field, "the field (default: the scene's, or the first)");
    command
        .add_option("--component", a.request.component,
                    "component of a vector, counted from 0 (default: the scene's, or its length)")
        ->check(CLI::Range(0, 8));
    command.add_option("--size", a.size, "pixels, such as 1920x1080 (default: the scene's, or 1024x768)");
    command.add_option("--samples", a.request.samplesAPixel, "rays a pixel (default: the scene's, or 4)")
        ->check(CLI::IsMember({1, 4, 9, 16}));
    command
        .add_option("--without", a.request.without,
                    "leave out this effect of the scene, by its name there; may be repeated")
        ->allow_extra_args(false);
    command.add_flag("--explain", a.request.explains,
                     "tell what each effect costs, and how much of the picture it changes");
    command.add_option("--frames", a.frames.frames, "draw so many pictures, numbered from 1")
        ->check(CLI::Range(1, 1'000'000));
    auto* path = command.add_option(
        "--path", a.frames.path,
        "a JSON file with key frames that the camera moves through, from the first to the last");
    command.add_flag("--orbit", a.frames.orbits, "the camera turns once around what it looks at")
        ->excludes(path);
    command.add_option("--gl", a.gl, "OpenGL platform (default: the first that can be had)")
        ->check(CLI::IsMember({"egl-device", "egl-surfaceless", "osmesa"}));
    addCommonOptions(command, a.common);
    command.footer(
        "Examples:\n  tessera render flow.vdb -o flow.png\n"
        "  tessera render flow.vdb --scene scene.json -o flow.png --size 1920x1080 --samples 9\n"
        "  tessera render flow.vdb -o frame_%04d.png --frames 120 --orbit");
}

void addPictureOptions(CLI::App& command, PictureArguments& a) {
    command.add_option("vdb", a.request.input, "a .vdb file that tessera wrote")->required();
    command.add_option("-o,--output", a.request.output, "the .png file; - for standard output")->required();
    command.add_option("--field", a.request.field, "the field (default: the first)");
    command
        .add_option("--component", a.request.component,
                    "component of a vector, counted from 0 (default: its length)")
        ->check(CLI::Range(0, 8));
    command.add_option("--axis", a.axis, "the slice is normal to this axis")
        ->check(CLI::IsMember({"x", "y", "z"}))
        ->capture_default_str();
    command.add_option("--at", a.request.at, "where along that axis, world units (default: the middle)");
    command.add_option("--bounds", a.bounds, "show only the box x0,y0,z0,x1,y1,z1");
    command.add_option("--range", a.range,
                       "values a,b at the ends of the colour map (default: those of the slice)");
    command.add_option("--mesh", a.request.mesh,
                       "the mesh file: draws up to the mesh's surface instead of whole voxels");
    command.add_option("--pixels", a.request.pixels, "along the longer edge")
        ->check(CLI::Range(16, 8192))
        ->capture_default_str();
    command.add_flag("--bricks", a.request.bricks, "draw the edges of the bricks");
    addCommonOptions(command, a.common);
    command.footer(
        "Examples:\n  tessera picture flow.vdb -o slice.png --field pressure --axis z --at 0\n"
        "  tessera picture flow.vdb -o near.png --field velocity --bounds -1,-1,-1,1,1,1 --bricks --mesh "
        "flow.vtu");
}

void addSliceOptions(CLI::App& command, SliceArguments& a) {
    const std::string where = "Where to cut", what = "What to write";
    command.add_option("mesh", a.request.input, "a mesh file")->required();
    command
        .add_option("-o,--output", a.request.output,
                    "a .exr file (32-bit floats: a channel for every component of every field, and "
                    "coverage) or a .png file (one field in colours, with a legend); - for standard output")
        ->required();
    addFormat(command, a.request.format, {"exr", "png"});
    command
        .add_option("--origin", a.origin,
                    "a point x,y,z of the plane (default: the middle of the mesh's box)")
        ->group(where);
    command.add_option("--normal", a.normal, "the plane's normal a,b,c, of any length")
        ->capture_default_str()
        ->group(where);
    command
        .add_option(
            "--up", a.up,
            "what points up in the picture: its projection onto the plane (default: y for a normal "
            "nearest to the z axis, else z; so axes right and up are x,y for z, x,z for y, y,z for x)")
        ->group(where);
    command
        .add_option(
            "--size", a.size,
            "width and height w,h, or one length s for both, around the origin, in world units (default: as "
            "large as the cut)")
        ->group(where);
    command.add_option("--resolution", a.request.cut.resolution, "pixels along the longer edge")
        ->check(CLI::Range(1, kLargestCutResolution))
        ->capture_default_str()
        ->group(where);
    addTimeStep(command, a.request.timeStep)->group(where);
    command
        .add_option("--field", a.fields,
                    "fields to sample: a,b=newname,... (default: all for .exr, the first for .png)")
        ->group(what);
    command
        .add_option("--component", a.request.component,
                    ".png: component of a vector, counted from 0 (default: its length)")
        ->check(CLI::Range(0, 8))
        ->group(what);
    command
        .add_option("--range", a.range,
                    ".png: values a,b at the ends of the colour map (default: those of the cut)")
        ->group(what);
    addAlgorithmOptions(command, a.algorithm);
    addRepairOptions(command, a.repair);
    addCommonOptions(command, a.common);
    command.footer(
        "Pixels outside the mesh hold 0 and coverage 0; a value that isn't finite is NaN.\n"
        "Examples:\n  tessera slice flow.vtu -o cut.exr --origin 0,0,0.5 --normal 1,1,0\n"
        "  tessera slice flow.vtu -o cut.png --normal 0,1,0 --field pressure --range 0,2\n"
        "  tessera slice flow.vtu -o near.exr --origin 1,2,0 --normal 0,0,1 --size 0.5 --resolution 4096");
}

void addFocusTraceOptions(CLI::App& command, FocusTraceArguments& a) {
    const std::string where = "Where to sample how finely";
    FocusTraceRequest& r = a.request;
    command.add_option("mesh", r.input, "a mesh file")->required();
    command
        .add_option("--path", r.path,
                    "a text file of the places that the focus moves to: a line x y z each, in world units; # "
                    "begins a comment")
        ->required();
    command.add_option("-o,--output", r.output,
                       "a .csv file (a line a step) or a .html file (a page with plots and a table); - for "
                       "standard output; without, a table is printed and nothing written");
    addFormat(command, r.format, {"csv", "html"});
    command
        .add_option("--radius", r.radiusWorld,
                    "distance from the focus up to which spacing is the finest; beyond, it grows in "
                    "proportion to the distance")
        ->required()
        ->check(isLength())
        ->group(where);
    auto* resolution =
        command
            .add_option("--resolution", r.resolution,
                        "lattice points along the longest axis, at the finest level (default: 256)")
            ->check(CLI::Range(2, 1 << 20))
            ->group(where);
    command.add_option("--spacing", r.spacingWorld, "spacing of the finest level, in world units")
        ->check(isLength())
        ->excludes(resolution)
        ->group(where);
    command.add_option("--brick-size", r.brickCells, "cells along a brick's edge: 8, 16, 32 or 64")
        ->check(CLI::IsMember({8, 16, 32, 64}))
        ->capture_default_str()
        ->group(where);
    command.add_option("--budget", a.budget, "memory that all bricks together may take, e.g. 500M")
        ->capture_default_str()
        ->group(where);
    command.add_option("--frame-ms", r.frameMs, "milliseconds that one update samples for")
        ->check(numbersWithin(0.01, 60000))
        ->capture_default_str()
        ->group(where);
    command.add_option("--field", a.fields,
                       "fields to sample: a,b (default: all); errors are those of the first one that has "
                       "values at points, its first component");
    addTimeStep(command, r.timeStep);
    addAlgorithmOptions(command, a.algorithm);
    addRepairOptions(command, a.repair);
    addCommonOptions(command, a.common);
    command.footer(
        "Moves a focus along the path and waits at each place until all bricks are as fine as wished for. "
        "Tells when the brick at the focus became finer, when everything was at rest, how many bricks were "
        "sampled, reused and dropped, and how far the samples near the focus are from the mesh.\n"
        "Examples:\n  tessera focus-trace flow.vtu --path points.txt --radius 0.2\n"
        "  tessera focus-trace flow.vtu --path points.txt --radius 0.2 -o trace.html --budget 500M\n"
        "  tessera focus-trace flow.vtu --path points.txt --radius 0.2 -o trace.csv --resolution 1024");
}

void addCompareOptions(CLI::App& command, CompareArguments& a) {
    command.add_option("mesh", a.request.meshes, "mesh files")->required();
    command.add_option(
        "--algorithms", a.request.algorithms,
        "names with commas between them, each with a target if wanted, and with who makes its primitives: "
        "software,slicing:osmesa,hybrid:processor; "
        "the first is what the others are compared with (default: all that can run here)");
    addBindOptions(command, a.algorithm);
    auto* resolution = command
                           .add_option("--resolution", a.request.resolution,
                                       "lattice points along the longest axis (default: 128)")
                           ->check(CLI::Range(2, 1 << 20));
    command.add_option("--spacing", a.request.spacing, "spacing of the lattice, in world units")
        ->check(CLI::PositiveNumber)
        ->excludes(resolution);
    command.add_option("--field", a.fields, "fields to sample: a,b (default: all)");
    command.add_option("--runs", a.request.runs, "runs of each algorithm; times are medians")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    command
        .add_option("--box", a.request.boxEdge,
                    "points along the edge of the boxes sampled at once; smaller ones are taken when many "
                    "channels need it")
        ->check(CLI::Range(16, 512))
        ->capture_default_str();
    command.add_flag("--markdown", a.request.markdown,
                     "print one table in Markdown, one row a mesh and algorithm");
    addTimeStep(command, a.request.timeStep);
    addRepairOptions(command, a.repair);
    addCommonOptions(command, a.common);
    command.footer(
        "Samples the mesh by each algorithm on one lattice and compares coverage, values and times; checks "
        "every "
        "sample against the mesh. Exit\ncode 1 when coverage differs away from the mesh boundary or a sample "
        "is "
        "wrong.\n"
        "Examples:\n  tessera compare mesh.vtu\n"
        "  tessera compare mesh.vtu --algorithms software,slicing,hybrid --resolution 256 --field pressure\n"
        "  tessera compare mesh.vtu --algorithms software,slicing --sample-format r8 --json report.json\n"
        "  tessera compare mesh.vtu --algorithms hybrid,hybrid:processor --resolution 256\n"
        "  tessera compare *.vtu --markdown");
}

void addBenchOptions(CLI::App& command, BenchArguments& a) {
    command.add_option("mesh", a.request.mesh, "mesh file")->required();
    command
        .add_option("-o,--output", a.request.folder, "the folder for the report; made when it isn't there")
        ->required();
    command.add_flag("--quick", a.request.isQuick, "fewer cases: about a minute on two cores");
    command.add_option("--field", a.request.field,
                       "the field to sample (default: the first scalar field of the points)");
    command.add_option("--algorithms", a.request.algorithms,
                       "only these, as in compare (default: all, with all targets, formats and threads)");
    command.add_option("--gl", a.algorithm.gl, "OpenGL platform (default: the first that can be had)")
        ->check(CLI::IsMember({"egl-device", "egl-surfaceless", "osmesa"}));
    command
        .add_option("--peer", a.peers,
                    "name=command: a program of yours that samples meshes (docs/benchmark_peers.md); may be "
                    "repeated")
        ->type_size(1)
        ->allow_extra_args(false);
    command.add_flag("--no-vtk", a.withoutVtk, "without VTK's vtkResampleToImage as a peer");
    command.add_option("--points", a.request.resolutions, "lattice points along the longest axis: a,b,...")
        ->delimiter(',')
        ->check(CLI::Range(2, 1024));
    command.add_option("--runs", a.request.rounds, "rounds at most (default: 9, quick 6)")
        ->check(CLI::Range(1, 1000));
    command
        .add_option("--seconds", a.request.seconds,
                    "for all rounds together, beside one first run of each case: there are fewer where they "
                    "would take longer, and where 6 would, the longest cases are left out (default: 300, "
                    "quick 24)")
        ->check(CLI::Range(1.0, 1e6));
    command
        .add_option("--longest-run", a.request.longestSeconds,
                    "seconds: cases that take longer are left out (default: 2.5, quick 0.3)")
        ->check(CLI::Range(1e-3, 1e6));
    command.add_option("--seed", a.request.seed, "of the orders and of the places that are checked")
        ->capture_default_str();
    command.add_option("--compare", a.request.comparedWith,
                       "the report.json of an earlier run: tells what got faster or slower since");
    addCommonOptions(command, a.common);
    command.footer(
        "Times every algorithm, in all its ways, and peers on this mesh, in rounds of random order; measures "
        "their errors against exact arithmetic, of the reconstruction and of pictures. Writes index.html, "
        "report.json, runs.csv and oracle.csv into the folder.\n"
        "Examples:\n  tessera bench flow.vtu -o report --quick\n"
        "  tessera bench flow.vtu -o report --field pressure --compare earlier/report.json\n"
        "  tessera bench flow.vtu -o report --peer \"probe=python3 bench/peer_probe.py\"");
}

/// A command that runs with what its options were given.
template <class Arguments>
void addCommand(CLI::App& app, CommandLine& line, const char* name, const char* description,
                void (*addOptions)(CLI::App&, Arguments&), int (*run)(const Arguments&)) {
    CLI::App& command = *app.add_subcommand(name, description);
    const auto arguments = std::make_shared<Arguments>();
    addOptions(command, *arguments);
    command.callback([&line, arguments, run] { line.run = [arguments, run] { return run(*arguments); }; });
}

/// What follows is read by the program that has the window.
void addView(CLI::App& app, CommandLine& line) {
    CLI::App& command = *app.add_subcommand("view", "show a mesh or a .vdb file in a window");
    command.set_help_flag();
    command.prefix_command();
    command.callback(
        [&line, &command] { line.run = [words = command.remaining()] { return runView(words); }; });
}

void describe(CLI::App& app, CommandLine& line) {
    nameProgram(app, "tessera", fmt::format("tessera {}", TESSERA_VERSION));
    app.require_subcommand(1);
    app.footer(
        "Example:\n  tessera resample flow.vtu -o flow.vdb\n'tessera <command> --help' tells more. Exit "
        "codes: 0 done, "
        "2 bad input or usage, 3 a result that isn't what was asked for (with --strict), 1 any other "
        "failure, "
        "130 interrupted.");
    addCommand(app, line, "resample", "mesh file -> adaptive OpenVDB file, with an error report",
               addResampleOptions, runResample);
    addCommand(app, line, "info", "what a mesh file or a .vdb file holds, or what OpenGL there is",
               addInfoOptions, runInfo);
    addCommand(app, line, "verify", "check a .vdb file's error report against its mesh", addVerifyOptions,
               runVerify);
    addCommand(app, line, "tets", "write the tetrahedra that a mesh is split into", addTetsOptions, runTets);
    addCommand(app, line, "picture", "draw one slice of a .vdb file as a .png", addPictureOptions,
               runPicture);
    addCommand(app, line, "render", "draw the volume of a .vdb file or a mesh: a .png or .exr",
               addRenderOptions, runRender);
    addView(app, line);
    addCommand(app, line, "compare", "several algorithms on one lattice: coverage, values, times",
               addCompareOptions, runCompare);
    addCommand(app, line, "bench", "what accuracy costs in time: every algorithm and peers, as a page",
               addBenchOptions, runBench);
    addCommand(app, line, "slice", "cut a mesh with any plane: a float EXR or a .png", addSliceOptions,
               runSlice);
    addCommand(app, line, "focus-trace", "replay a moving focus: times, bricks and errors, step by step",
               addFocusTraceOptions, runFocusTrace);
}

}  // namespace

CommandLine parseCommandLine(int argc, char** argv) {
    CLI::App app("Resamples simulation meshes into adaptive bricks of voxels.");
    CommandLine line;
    describe(app, line);
    const auto isFirstWord = [&](const CLI::App* command) { return command->get_name() == argv[1]; };
    if (argc > 1 && argv[1][0] != '-' && app.get_subcommands(isFirstWord).empty())
        throw InputError(fmt::format("there is no command '{}' (tessera --help lists them)", argv[1]));
    parseWords(app, argc, argv, line);
    return line;
}

}  // namespace tessera
