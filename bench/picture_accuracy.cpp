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
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "arguments.h"
#include "benchmark/xy_plot.h"
#include "job/mesh_source.h"
#include "job/scene_picture.h"
#include "job/vdb_source.h"
#include "mesh_files/read_mesh.h"
#include "reference/mesh_cast.h"
#include "reference/ray_cast.h"
#include "refine/plan.h"
#include "schedule/schedule_bricks.h"
#include "tessera/error.h"
#include "tessera/registry.h"
#include "vdb/shape_output.h"
#include "vdb/vdb_write.h"

namespace {

using namespace tessera;

/// Pixels around a silhouette that count as beside it.
constexpr int kBeside = 4;
/// Of rays that are cut with the mesh.
constexpr double kStepVoxels = 0.25;
/// A share of the range that no budget here reaches.
constexpr double kLeastError = 1e-4;

struct Options {
    std::vector<std::string> meshes;
    std::vector<std::int64_t> budgets{300'000, 1'000'000, 3'000'000, 10'000'000, 30'000'000};
    std::string csvPath, plotPath, picturesPath;
    int size = 512, brickCells = 16, threads = 2;
};

/// How many pixels see the mesh, and which of them aren't beside a silhouette.
struct Seen {
    std::vector<bool> inside;
    std::int64_t meshCount = 0, insideCount = 0;
};

Seen seenBy(const MeshRays& rays) {
    const int width = rays.camera().widthPixels, height = rays.camera().heightPixels;
    Seen seen;
    const auto partsAt = [&](int x, int y) { return rays.spans(x, y).size(); };
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            bool isInside = partsAt(x, y) > 0;
            seen.meshCount += isInside;
            for (int j = std::max(0, y - kBeside); j <= std::min(height - 1, y + kBeside) && isInside; ++j)
                for (int i = std::max(0, x - kBeside); i <= std::min(width - 1, x + kBeside); ++i)
                    isInside = isInside && partsAt(i, j) == partsAt(x, y);
            seen.insideCount += isInside;
            seen.inside.push_back(isInside);
        }
    return seen;
}

/// In steps of 1/255.
struct Differences {
    double all = 0, inside = 0;
};

Differences differencesOf(const RgbaImage& image, const RgbaImage& exact, const Seen& seen) {
    double all = 0, inside = 0;
    for (std::size_t p = 0; p < image.pixels.size(); ++p)
        for (std::size_t c = 0; c < 3; ++c) {
            const double apart = 255 * (double(image.pixels[p][c]) - double(exact.pixels[p][c]));
            all += apart * apart;
            if (seen.inside[p]) inside += apart * apart;
        }
    const auto root = [](double sum, std::int64_t pixels) {
        return std::sqrt(sum / (3 * double(std::max<std::int64_t>(pixels, 1))));
    };
    return {root(all, seen.meshCount), root(inside, seen.insideCount)};
}

/// What came of one budget.
struct Row {
    const char* criterion = "";
    std::int64_t budget = 0, voxels = 0;
    int levels = 0;
    double largestError = 0, resampleMs = 0, drawMs = 0;
    Differences drawn, clipped, values;
};

constexpr const char* kCsvHeading =
    "mesh,field,criterion,budget,voxels,levels,largest_error,resample_ms,draw_ms,all_255,inside_255,"
    "clipped_all_255,clipped_inside_255,values_all_255,values_inside_255\n";

std::string csvText(const Row& row) {
    return fmt::format("{},{},{},{},{:.5g},{:.0f},{:.0f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f}\n",
                       row.criterion, row.budget, row.voxels, row.levels, row.largestError, row.resampleMs,
                       row.drawMs, row.drawn.all, row.drawn.inside, row.clipped.all, row.clipped.inside,
                       row.values.all, row.values.inside);
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
        row.drawn.all, row.drawn.inside, row.clipped.all, row.values.all);
}

class Bench {
  public:
    Bench(const Options& options, const TetMesh& mesh, const std::string& field)
        : options_(options),
          execution_{.threads = options.threads},
          scene_(sceneOf(options, field)),
          source_(mesh, scene_, 0, thread(), execution_),
          picture_(pictureOf(scene_, source_, false).options),
          nearest_(source_.mesh(), options.threads),
          rays_(source_.mesh(), picture_.camera, execution_),
          seen_(seenBy(rays_)),
          renderer_(thread()) {
        const Timer timer;
        exact_ = castMesh(source_.mesh(), picture_.camera,
                          {.function = picture_.function, .layerWorld = picture_.layerWorld}, execution_);
        exactMs_ = timer.elapsedMs();
        keep("exact", exact_);
    }

    const std::string& title() const { return source_.title(); }
    double exactMs() const { return exactMs_; }
    const Seen& seen() const { return seen_; }

    Row measure(Criterion criterion, std::int64_t budget);

  private:
    static GlThread& thread() { return sharedGlThread(chooseGlPlatform({})); }
    static Scene sceneOf(const Options& options, const std::string& field) {
        Scene scene;
        scene.field = field;
        scene.width = scene.height = options.size;
        scene.samplesAPixel = 1;
        scene.hasLegend = false;
        return scene;
    }
    RefineOptions refineBy(Criterion criterion, std::int64_t budget) const;
    void keep(const std::string& name, const RgbaImage& image) const {
        if (options_.picturesPath.empty()) return;
        writePng(options_.picturesPath + "/" + title() + "_" + name + ".png",
                 overGround(image, scene_.ground));
    }

    const Options& options_;
    Execution execution_;
    Scene scene_;
    MeshSource source_;  // for its mesh and what is chosen by it; nothing is sampled
    RenderOptions picture_;
    NearestOnDemand nearest_;
    MeshRays rays_;
    Seen seen_;
    SliceRenderer renderer_;
    RgbaImage exact_;
    double exactMs_ = 0;
};

RefineOptions Bench::refineBy(Criterion criterion, std::int64_t budget) const {
    RefineOptions refine;
    refine.criterion = criterion;
    refine.brickCells = options_.brickCells;
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
        const BrickTree tree = planBricks(source_.mesh(), refine, execution_);
        (std::int64_t(tree.leafCount()) * brick <= budget ? fits : tooFine) = refine.resolution;
    }
    refine.resolution = fits;
    return refine;
}

Row Bench::measure(Criterion criterion, std::int64_t budget) {
    const TetMesh& mesh = source_.mesh();
    const std::vector<int> fields{0};
    const Resampler& resampler = findResampler("software");
    const RefineOptions refine = refineBy(criterion, budget);
    Row row;
    row.criterion = criterion == Criterion::error ? "by error" : "uniform";
    row.budget = budget;
    BrickResult result = makeBricks(mesh, fields, resampler, refine, execution_);
    row.voxels =
        std::int64_t(result.tree.leafCount()) * refine.brickCells * refine.brickCells * refine.brickCells;
    row.levels = result.tree.levelCount();
    row.largestError = result.report.fields[0].relativeMax;
    const Timer timer;
    const Field& field = mesh.fields[0];
    const std::vector<OutputField> outputs{
        {"f", field.name, field.location == FieldLocation::cell ? "cell" : "point", 1, 0}};
    OutputShape shape;
    shape.layers = 1;
    shapeForFile(mesh, fields, outputs, resampler, refine.bind, shape, result, execution_);
    row.resampleMs = result.times.planMs + result.times.resampleMs + timer.elapsedMs();
    const RayCaster caster(result.tree, {mesh, fields, result.tree, result.store, nearest_}, 0, execution_);
    row.values =
        differencesOf(caster.draw(rays_, picture_.function,
                                  {.layerWorld = picture_.layerWorld, .stepVoxels = kStepVoxels}, execution_),
                      exact_, seen_);

    const auto path = std::filesystem::temp_directory_path() /
                      fmt::format("picture_accuracy_{}.vdb", static_cast<long long>(getpid()));
    VdbWriteOptions write;
    write.layers = shape.layers;
    writeVdb(path.string(), outputs, result, write, execution_);
    Job job;
    job.execution = execution_;
    const auto source = openVdbSource(path.string(), "", {}, thread(), job);
    std::filesystem::remove(path);

    const auto draw = [&](const RenderOptions& options) {
        RenderCounts counts;
        RgbaImage image = renderer_.draw(source->pool(), *source->pool().state(), source->frame(),
                                         source->bricks(), options, execution_, &counts);
        row.drawMs = counts.drawMs;
        return image;
    };
    RenderOptions clipped = picture_;
    const Box3d& bounds = source_.boundsWorld();
    for (int a = 0; a < 3; ++a) {
        Vec3d axis(0);
        axis[a] = 1;
        clipped.within.push_back({axis, bounds.min[a]});
        clipped.within.push_back({-axis, -bounds.max[a]});
    }
    row.clipped = differencesOf(draw(clipped), exact_, seen_);
    const RgbaImage drawn = draw(picture_);  // the second time: shaders are made
    row.drawn = differencesOf(drawn, exact_, seen_);
    keep(fmt::format("{}_{}", criterion == Criterion::error ? "error" : "uniform", budget), drawn);
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
        Bench bench(options, readMesh(path, {}, {.threads = options.threads}).mesh, field);
        const std::string file = std::filesystem::path(path).filename().string();
        const std::string name = file + ", " + bench.title();
        notes +=
            fmt::format("{}: the exact picture took {:.2g} s; {} pixels see the mesh, {} of them inside\n",
                        name, 1e-3 * bench.exactMs(), bench.seen().meshCount, bench.seen().insideCount);
        XyPlot& plot = plots.emplace_back();
        plot.title = name;
        for (const Criterion criterion : {Criterion::error, Criterion::uniform}) {
            XySeries drawn = seriesOf(criterion), values = drawn;
            values.label += ", values alone", values.style.dash = 1, values.style.isHollow = true;
            for (const std::int64_t budget : options.budgets) {
                const Row row = bench.measure(criterion, budget);
                fmt::print("{}", tableText(inTable(name), row));
                std::fflush(stdout);
                if (csv.is_open()) csv << file << ',' << bench.title() << ',' << csvText(row) << std::flush;
                drawn.points.push_back({.x = double(row.voxels), .y = row.drawn.all, .tip = {}});
                values.points.push_back({.x = double(row.voxels), .y = row.values.all, .tip = {}});
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
