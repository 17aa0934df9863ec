// tessera-tetrahedralize: surfaces and scattered points to tetrahedra, by TetGen.
#include <fmt/format.h>
#include <unistd.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "files/temporary_folder.h"
#include "graded_points.h"
#include "job/tetrahedralize_file.h"
#include "option_groups.h"
#include "reader/isolated_tetrahedra.h"
#include "run_program.h"
#include "session.h"
#include "tessera/error.h"
#include "tetgen/tetrahedralize_task.h"

namespace tessera {

namespace {

struct Arguments {
    CommonOptions common;
    std::string fields, boundary = "keep";
    std::vector<std::string> holes, regions;
    TetrahedralizeRequest request;
};

/// "x,y,z" or "x,y,z:size".
RegionSeed parseRegion(const std::string& text) {
    const std::size_t colon = text.find(':');
    RegionSeed seed;
    seed.placeWorld = parseVector("--region", text.substr(0, colon));
    if (colon == std::string::npos) return seed;
    seed.sizeWorld = parseNumbers("--region", text.substr(colon + 1), 1).front();
    if (!(seed.sizeWorld > 0))
        throw InputError(fmt::format("--region: expected a size above 0 behind the colon, got '{}'", text));
    return seed;
}

void addSizeOptions(CLI::App& app, SizeWishes& size) {
    const std::string group = "How fine (surfaces; world units)";
    app.add_option("--size", size.everywhere, "length of edges everywhere")->check(isLength())->group(group);
    app.add_option("--size-surface", size.atSurface, "length of edges at the surface")
        ->check(isLength())
        ->group(group);
    app.add_option("--size-field", size.field, "a field of the surface's points that holds the length there")
        ->group(group);
    app.add_option("--edges-per-circle", size.edgesPerCircle,
                   "at the surface, by its curvature: so many edges around a circle")
        ->check(numbersWithin(3, 10000))
        ->group(group);
    app.add_option("--growth", size.growth,
                   "by how much edges may get longer for every unit of distance from the surface")
        ->check(numbersWithin(0, 1000))
        ->capture_default_str()
        ->group(group);
    app.add_option("--min-size", size.smallest, "no shorter edges by the field or the curvature")
        ->check(isLength())
        ->group(group);
}

void addShapeOptions(CLI::App& app, Arguments& a) {
    const std::string group = "What is made";
    TetrahedralizeOptions& o = a.request.options;
    app.add_option("--quality", o.quality, "bound on an element's circumradius over its shortest edge")
        ->check(numbersWithin(1, 100))
        ->capture_default_str()
        ->group(group);
    app.add_option("--min-dihedral", o.minDihedralDegrees, "smallest dihedral angle wished for, in degrees")
        ->check(numbersWithin(0, 60))
        ->capture_default_str()
        ->group(group);
    app.add_option(
           "--boundary", a.boundary,
           "keep: the surface's triangles stay as they are. refine: they may be split where that helps "
           "quality or size")
        ->check(CLI::IsMember({"keep", "refine"}))
        ->capture_default_str()
        ->group(group);
    app.add_option("--hole", a.holes,
                   "a place x,y,z in a part of the volume that stays empty; may be repeated. Parts of the "
                   "surface that lie inside others and look inwards are holes by themselves")
        ->type_size(1)
        ->allow_extra_args(false)
        ->group(group);
    app.add_option(
           "--region", a.regions,
           "a place x,y,z in a part of the volume that inner surfaces bound, with a length of edges if "
           "wanted (x,y,z:size); may be repeated. The cell field 'region' numbers them from 1")
        ->type_size(1)
        ->allow_extra_args(false)
        ->group(group);
    app.add_option("--hull-limit", o.hullLimitWorld,
                   "scattered points: tetrahedra with a longer edge are left out, so that bays stay empty")
        ->check(isLength())
        ->group(group);
    app.add_flag("--repair-surface", o.repairs,
                 "merge points at the same place, remove triangles without area or there twice, and turn "
                 "triangles that run the other way round")
        ->group(group);
    app.add_option("--field", a.fields, "fields to carry over: a,b=newname (default: all)")->group(group);
}

void addLimits(CLI::App& app, ReaderArguments& reader) {
    const std::string group = "Limits";
    app.add_option("--max-memory", reader.maxMemory,
                   "memory that the run may take, e.g. 4G (default: three quarters of the memory here)")
        ->group(group);
    app.add_option("--max-time", reader.maxSeconds,
                   "seconds that reading and TetGen may take (default: 120 of processor time, more for large "
                   "files, and an hour more where sizes are wished for)")
        ->check(numbersWithin(0.01, 1e8))
        ->group(group);
}

int run(const Arguments& a) {
    TetrahedralizeRequest request = a.request;
    request.options.splitsBoundary = a.boundary == "refine";
    if (!a.fields.empty()) request.fields = parseFields(a.fields);
    for (const std::string& hole : a.holes) request.options.holesWorld.push_back(parseVector("--hole", hole));
    for (const std::string& region : a.regions) request.options.regions.push_back(parseRegion(region));
    Session session(a.common, request.output);
    session.job.tetrahedralizer = IsolatedReader{programPath(), {kMakeTetrahedraCommand}, {}, "--max-time"};
    std::optional<TemporaryFolder> folder;
    if (const auto points = gradedPointCount(request.input)) {
        folder.emplace("tessera-graded-");
        request.input = folder->pathOf("graded.csv");
        writeGradedPoints(request.input, *points);
    }
    session.writeReport(tetrahedralizeJson(request, tetrahedralizeFile(request, session.job), session.job));
    return session.exitCode();
}

CommandLine parse(int argc, char** argv) {
    CLI::App app("Makes tetrahedra of a closed surface or of scattered points.");
    nameProgram(
        app, kTetrahedralizer,
        fmt::format(
            "{} {}, with TetGen 1.5\n"
            "TetGen is under the GNU Affero General Public License (AGPL), version 3 or later, and so "
            "is this program as a whole.\nThe other programs of Tessera don't contain it.",
            kTetrahedralizer, TESSERA_VERSION));
    const auto arguments = std::make_shared<Arguments>();
    Arguments& a = *arguments;
    app.add_option(
           "input", a.request.input,
           "a surface (.stl .ply .obj .off .poly .vtp .vtu .vtk) or scattered points (.csv .node .vtp "
           ".ply .vtk); graded:N makes N points, as the mesh that speed is measured on")
        ->required();
    app.add_option("-o,--output", a.request.output, "the .vtu file; - for standard output")->required();
    addSizeOptions(app, a.request.options.size);
    addShapeOptions(app, a);
    addLimits(app, a.common.reader);
    addRunOptions(app, a.common);
    app.footer(
        "Fields of the points are carried to all nodes. A surface that is open, crosses itself or is turned "
        "is "
        "refused, with the place and its first ten triangles.\n"
        "Examples:\n  tessera-tetrahedralize part.stl -o part.vtu --edges-per-circle 24\n"
        "  tessera-tetrahedralize shell.ply -o shell.vtu --size 0.5 --hole 0,0,0\n"
        "  tessera-tetrahedralize stations.csv -o stations.vtu --hull-limit 2000\n"
        "  tessera resample stations.csv -o stations.vdb   (starts it by itself)");
    CommandLine line;
    parseWords(app, argc, argv, line);
    if (line.text.empty()) line.run = [arguments] { return run(*arguments); };
    return line;
}

int makeForParent(const std::vector<std::string>& words) {
    const std::vector<ReaderTask> tasks{tetrahedralizeTask()};
    return serveReader(words, tasks);
}

}  // namespace

}  // namespace tessera

int main(int argc, char** argv) {
    if (argc > 1 && std::string(argv[1]) == tessera::kMakeTetrahedraCommand)
        ::_exit(tessera::serveParent({argv + 2, argv + argc}, tessera::makeForParent));
    return tessera::runProgram(tessera::kTetrahedralizer, [&] { return tessera::parse(argc, argv); });
}
