// How far pictures are from those of the mesh itself, by the voxels they are drawn from:
// picture_accuracy mesh.vtu:field ... [--budgets 300000,1000000,...] [--csv path] [--plot path.svg]
//
// The exact picture is that of castMesh(): rays cut with the elements, without any sampling. Each other one
// is that of `tessera render` without a scene, with one ray a pixel and no legend: the mesh is resampled
// within a budget of voxels, by error as far as the budget goes and as the finest uniform lattice within it,
// written with --extend 1 as a .vdb file, and drawn from there. Camera, transfer function and layer are those
// that `tessera render` chooses for the mesh.
//
// Differences are those of red, green and blue before any ground, in steps of 1/255: the root of the mean
// square over the pixels whose ray meets the mesh, what is drawn beside them counted with them ("RMS"), and
// over those that are further than four pixels from where the number of the mesh's parts along the ray
// changes ("inside"), as it does at silhouettes. "clipped": with a clip box at the mesh's bounds, beyond
// which voxels reach. "values": by fine steps of rays that are cut with the elements, as in the exact
// picture, so that neither the outline of voxels nor slices count. Milliseconds are those of planning,
// sampling and the extension, and of drawing.

#include <fmt/format.h>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "arguments.h"
#include "benchmark/picture_errors.h"
#include "benchmark/xy_plot.h"
#include "job/scene_picture.h"
#include "mesh_files/read_mesh.h"
#include "refine/plan.h"
#include "schedule/schedule_bricks.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace {

using namespace tessera;

/// A share of the range that no budget here reaches.
constexpr double kLeastError = 1e-4;

struct Options {
    std::vector<std::string> meshes;
    std::vector<std::int64_t> budgets{300'000, 1'000'000, 3'000'000, 10'000'000, 30'000'000};
    std::string csvPath, plotPath, picturesPath;
    int size = 512, brickCells = 16, threads = 2;
};

/// What came of one budget.
struct Row {
    const char* criterion = "";
    std::int64_t budget = 0, voxels = 0;
    int levels = 0;
    double largestError = 0, resampleMs = 0, drawMs = 0;
    PictureErrors errors;
};

constexpr const char* kCsvHeading =
    "mesh,field,criterion,budget,voxels,levels,largest_error,resample_ms,draw_ms,all_255,inside_255,"
    "clipped_all_255,clipped_inside_255,values_all_255,values_inside_255\n";

std::string csvText(const Row& row) {
    return fmt::format("{},{},{},{},{:.5g},{:.0f},{:.0f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f}\n",
                       row.criterion, row.budget, row.voxels, row.levels, row.largestError, row.resampleMs,
                       row.drawMs, row.errors.drawn.all, row.errors.drawn.inside, row.errors.clipped.all,
                       row.errors.clipped.inside, row.errors.values.all, row.errors.values.inside);
}

constexpr const char* kTableHeading =
    "| mesh, field | bricks | voxels | levels | resampling | drawing | RMS | inside | clipped | values |\n"
    "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|\n";

/// A vector's length is called |v|, and columns end with a |.
std::string inTable(const std::string& text) {
    std::string escaped;
    for (const char c : text) {
        if (c == '|') escaped += '\\';
        escaped += c;
    }
    return escaped;
}

std::string tableText(const std::string& name, const Row& row) {
    return fmt::format(
        "| {} | {} | {:.3g} M | {} | {:.2g} s | {:.2g} s | {:.2f} | {:.2f} | {:.2f} | {:.3f} |\n", name,
        row.criterion, 1e-6 * double(row.voxels), row.levels, 1e-3 * row.resampleMs, 1e-3 * row.drawMs,
        row.errors.drawn.all, row.errors.drawn.inside, row.errors.clipped.all, row.errors.values.all);
}

RefineOptions refineBy(const Options& options, const TetMesh& mesh, Criterion criterion, std::int64_t budget,
                       const Execution& execution) {
    RefineOptions refine;
    refine.criterion = criterion;
    refine.brickCells = options.brickCells;
    refine.maxVoxels = budget;
    if (criterion == Criterion::error) {
        refine.maxError = kLeastError;
        return refine;
    }
    const std::int64_t brick = std::int64_t(refine.brickCells) * refine.brickCells * refine.brickCells;
    int fits = 2, tooFine = 4096;
    refine.maxVoxels = std::int64_t(1) << 40;
    while (fits + 1 < tooFine) {
        refine.resolution = (fits + tooFine) / 2;
        const BrickTree tree = planBricks(mesh, refine, execution);
        (std::int64_t(tree.leafCount()) * brick <= budget ? fits : tooFine) = refine.resolution;
    }
    refine.resolution = fits;
    return refine;
}

Row measure(const Options& options, const PictureReference& reference, Criterion criterion,
            std::int64_t budget, const Execution& execution) {
    const TetMesh& mesh = reference.mesh();
    const std::vector<int> fields{0};
    const Resampler& resampler = findResampler("software");
    const RefineOptions refine = refineBy(options, mesh, criterion, budget, execution);
    Row row;
    row.criterion = criterion == Criterion::error ? "by error" : "uniform";
    row.budget = budget;
    BrickResult result = makeBricks(mesh, fields, resampler, refine, execution);
    row.voxels =
        std::int64_t(result.tree.leafCount()) * refine.brickCells * refine.brickCells * refine.brickCells;
    row.levels = result.tree.levelCount();
    row.largestError = result.report.fields[0].relativeMax;
    row.errors = reference.measureAll(
        resampler, refine, result,
        fmt::format("{}_{}", criterion == Criterion::error ? "error" : "uniform", budget), execution);
    row.resampleMs = result.times.planMs + result.times.resampleMs + row.errors.extendMs;
    row.drawMs = row.errors.drawMs;
    return row;
}

std::ofstream opened(const std::string& path) {
    std::ofstream file(path);
    if (!file) throw IoError("can't write " + path);
    return file;
}

XySeries seriesOf(Criterion criterion) {
    const bool isByError = criterion == Criterion::error;
    return {isByError ? "by error" : "uniform",
            {},
            {isByError ? 0 : 1, isByError ? 3 : 0, 0, false, false},
            {},
            true,
            {}};
}

/// A panel a mesh, over the same axes.
std::string plotsSvg(std::vector<XyPlot> plots) {
    AxisRange voxels, rms;
    for (const XyPlot& plot : plots)
        for (const XySeries& series : plot.series)
            for (const XyPoint& point : series.points) voxels.include(point.x), rms.include(point.y);
    PlotFigure figure{"RMS against the exact picture, by voxels", {}, {}};
    for (XyPlot& plot : plots) {
        plot.x = {"voxels", AxisUnit::amount, false, false, voxels, {}};
        plot.y = {"RMS in steps of 1/255; below is closer", AxisUnit::plain, false, false, rms, {}};
        figure.panels.emplace_back([plot](const PlotCanvas& canvas) { return drawXyPlot(plot, canvas); });
    }
    return standaloneSvg(figure);
}

void run(const Options& options) {
    std::ofstream csv;
    if (!options.csvPath.empty()) csv = opened(options.csvPath), csv << kCsvHeading;
    std::vector<XyPlot> plots;
    fmt::print("{}", kTableHeading);
    std::string notes;
    for (const std::string& word : options.meshes) {
        const std::size_t colon = word.rfind(':');
        const std::string path = word.substr(0, colon);
        const std::string field = colon == std::string::npos ? "" : word.substr(colon + 1);
        const Execution execution{.threads = options.threads};
        PictureReference::Keep keep;
        if (!options.picturesPath.empty())
            keep = [&](const std::string& name, const RgbaImage& image) {
                writePng(options.picturesPath + "/" + field + "_" + name + ".png",
                         overGround(image, Scene().ground));
            };
        const PictureReference reference(readMesh(path, {}, execution).mesh, field, options.size, execution,
                                         keep);
        const std::string file = std::filesystem::path(path).filename().string();
        const std::string name = file + ", " + reference.title();
        notes +=
            fmt::format("{}: the exact picture took {:.2g} s; {} pixels see the mesh, {} of them inside\n",
                        name, 1e-3 * reference.exactMs(), reference.pixelsOfMesh(), reference.pixelsInside());
        XyPlot& plot = plots.emplace_back();
        plot.title = name;
        for (const Criterion criterion : {Criterion::error, Criterion::uniform}) {
            XySeries drawn = seriesOf(criterion), values = drawn;
            values.label += ", values alone", values.style.dash = 1, values.style.isHollow = true;
            for (const std::int64_t budget : options.budgets) {
                const Row row = measure(options, reference, criterion, budget, execution);
                fmt::print("{}", tableText(inTable(name), row));
                std::fflush(stdout);
                if (csv.is_open())
                    csv << file << ',' << reference.title() << ',' << csvText(row) << std::flush;
                drawn.points.push_back({.x = double(row.voxels), .y = row.errors.drawn.all, .tip = {}});
                values.points.push_back({.x = double(row.voxels), .y = row.errors.values.all, .tip = {}});
            }
            plot.series.push_back(drawn);
            plot.series.push_back(values);
        }
    }
    fmt::print("\n{}", notes);
    if (!options.plotPath.empty()) opened(options.plotPath) << plotsSvg(std::move(plots));
}

}  // namespace

int main(int count, char** words) {
    Options options;
    bench::Arguments arguments("How far pictures are from those of the mesh itself, by the voxels they take");
    arguments.addNeeded("meshes", options.meshes, "mesh files, each with :field or its first field");
    arguments.add("--budgets", options.budgets, "voxels, by commas");
    arguments.add("--size", options.size, "pixels of the picture's side", {8, 8192});
    arguments.add("--brick-size", options.brickCells, "");
    arguments.add("--threads", options.threads, "");
    arguments.add("--csv", options.csvPath, "writes the table there, too");
    arguments.add("--plot", options.plotPath, "an .svg file");
    arguments.add("--pictures", options.picturesPath, "a folder that keeps all pictures");
    return arguments.run(count, words, [&] {
        run(options);
        return 0;
    });
}
