// What refinement by visibility spares, and what it costs in the picture:
// visible_tenths [mesh] [--field Density] [--max-error 1] [--size 512] [--csv path]
//
// The mesh is refined by error alone, and then by error and visibility with each tenth of the field's range
// shown alone: its opacity rises over a share of the tenth at either end, its colour runs from red over white
// to blue. Both are drawn by rays from one camera that sees the whole mesh obliquely. The layer that has the
// transfer function's opacity is so thick that the pixels that show anything have a mean opacity of a half:
// neither faint nor saturated. Differences are those of red, green and blue in steps of 1/255: the root of
// the mean square over the pixels whose ray meets the mesh (RMS), the same over those that show anything
// (shown RMS), and the largest. "step" is what the picture (RMS) changes by with half the step. With an
// opacity of 0 everywhere the coarsest bricks should remain.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "arguments.h"
#include "benchmark/graded_box.h"
#include "mesh/field_range.h"
#include "mesh_files/read_mesh.h"
#include "reference/ray_cast.h"
#include "refine/camera_view.h"
#include "refine/plan_frame.h"
#include "schedule/schedule_bricks.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace {

using namespace tessera;

constexpr int kTenths = 10;
constexpr double kOpacity = 0.5;

struct Options {
    std::string meshPath, field, algorithm = "software", csvPath;
    double maxErrorPercent = 1, rise = 0.25, stepVoxels = 0.25;
    int size = 512, brickCells = 16, threads = 2;
};

/// Sees the whole box, from as near as it can.
Camera cameraAt(const Box3d& boundsWorld, int pixels) {
    Camera camera{.forwardWorld = {-0.55, -0.5, -0.67}, .openingDegrees = 30};
    camera.widthPixels = camera.heightPixels = pixels;
    const CameraView view = viewOf(camera);
    double away = 0;
    for (int c = 0; c < 8; ++c) {
        const Vec3d corner = boundsWorld.size() * (Vec3d(cornerOffset(c)) - 0.5);
        const double x = std::abs(glm::dot(corner, view.right)) / view.wide;
        const double y = std::abs(glm::dot(corner, view.up)) / view.high;
        away = std::max(away, std::max(x, y) - glm::dot(corner, view.forward));
    }
    camera.eyeWorld = boundsWorld.min + 0.5 * boundsWorld.size() - 1.02 * away * view.forward;
    return camera;
}

TransferFunction tenthShown(const ValueRange& range, int tenth, double rise) {
    const double width = range.width() / kTenths, low = range.min + tenth * width, high = low + width;
    const double middle = low + width / 2;
    const double risen = std::min(low + rise * width, middle), falls = std::max(high - rise * width, middle);
    const std::array<double, 3> red{1, 0.3, 0.2}, white{1, 1, 1}, blue{0.2, 0.4, 1};
    const auto mixed = [&](const std::array<double, 3>& from) {  // as far as the opacity takes to rise
        std::array<double, 3> color;
        for (std::size_t c = 0; c < 3; ++c) color[c] = from[c] + (white[c] - from[c]) * 2 * rise;
        return color;
    };
    return {"",
            {{low, red, 0},
             {risen, mixed(red), kOpacity},
             {middle, white, kOpacity},
             {falls, mixed(blue), kOpacity},
             {high, blue, 0}}};
}

std::int64_t shownPixels(const RgbaImage& image) {
    return std::count_if(image.pixels.begin(), image.pixels.end(),
                         [](const Rgba& pixel) { return pixel[3] > 0; });
}

/// Over the pixels that show anything.
double meanOpacity(const RgbaImage& image) {
    double sum = 0;
    for (const Rgba& pixel : image.pixels) sum += double(pixel[3]);
    return sum / double(std::max<std::int64_t>(shownPixels(image), 1));
}

/// What came of one tenth; differences in steps of 1/255.
struct Row {
    double low = 0, high = 0;
    std::int64_t voxels = 0;
    double share = 0;  ///< of the voxels by error alone
    double ms = 0;
    double shown = 0;  ///< of the pixels that see the mesh
    double layerWorld = 0, rms = 0, shownRms = 0, largest = 0, step = 0;
};

constexpr const char* kHeading =
    "tenth              values     voxels   share      ms   shown   layer     RMS"
    "  shown RMS  largest   step\n";
constexpr const char* kCsvHeading =
    "tenth,low,high,voxels,share,ms,shown,layer,rms_255,shown_rms_255,largest_255,step_255\n";

std::string text(int tenth, const Row& row) {
    return fmt::format(
        "{:>5} {:>9.4f}{:>10.4f} {:>10} {:>5.1f} % {:>7.0f} {:>6.2f}% {:>7.3g} {:>7.3f} {:>10.3f} {:>8.1f} "
        "{:>6.3f}\n",
        tenth, row.low, row.high, row.voxels, 100 * row.share, row.ms, 100 * row.shown, row.layerWorld,
        row.rms, row.shownRms, row.largest, row.step);
}

std::string csvText(int tenth, const Row& row) {
    return fmt::format("{},{:.6g},{:.6g},{},{:.4f},{:.0f},{:.5f},{:.4g},{:.4f},{:.4f},{:.2f},{:.4f}\n", tenth,
                       row.low, row.high, row.voxels, row.share, row.ms, row.shown, row.layerWorld, row.rms,
                       row.shownRms, row.largest, row.step);
}

class Bench {
  public:
    Bench(const Options& options, const TetMesh& mesh, int field)
        : options_(options),
          mesh_(mesh),
          fields_{field},
          execution_{.threads = options.threads},
          resampler_(findResampler(options.algorithm)),
          nearest_(mesh, options.threads),
          range_(finiteFloatRange(mesh.fields[std::size_t(field)], 0)),
          rays_(mesh, cameraAt(mesh.boundsWorld(), options.size), execution_),
          fewRays_(mesh, cameraAt(mesh.boundsWorld(), options.size / 2), execution_) {
        refine_.criterion = Criterion::error;
        refine_.maxError = options.maxErrorPercent / 100;
        refine_.brickCells = options.brickCells;
        refine_.bind.index = std::make_shared<const SharedElementIndex>(mesh);
        refine_.bind.index->get(execution_);
    }

    void run() const;

  private:
    struct Made {
        RayCaster caster;
        std::int64_t bricks = 0, voxels = 0;
        double finestWorld = 0, ms = 0;
    };
    Made make(const TransferFunction* function) const;
    double layerFor(const RayCaster& caster, const TransferFunction& function) const;
    Row compare(const Made& all, int tenth) const;

    const Options& options_;
    const TetMesh& mesh_;
    std::vector<int> fields_;
    Execution execution_;
    const Resampler& resampler_;
    NearestOnDemand nearest_;
    ValueRange range_;
    MeshRays rays_, fewRays_;
    RefineOptions refine_;
};

/// @param function what is shown; null: refined by error alone.
Bench::Made Bench::make(const TransferFunction* function) const {
    RefineOptions refine = refine_;
    if (function) {
        refine.criterion = Criterion::error | Criterion::visibility;
        refine.transferFunction = *function;
    }
    const BrickResult result = makeBricks(mesh_, fields_, resampler_, refine, execution_);
    for (const std::string& note : result.notes) std::printf("note: %s\n", note.c_str());
    if (!result.stoppedBecause.empty()) std::printf("stopped: %s\n", result.stoppedBecause.c_str());
    const std::int64_t bricks = std::int64_t(result.tree.leafCount());
    return {.caster = {result.tree, {mesh_, fields_, result.tree, result.store, nearest_}, 0, execution_},
            .bricks = bricks,
            .voxels = bricks * options_.brickCells * options_.brickCells * options_.brickCells,
            .finestWorld = result.tree.spacingWorld(),
            .ms = result.times.planMs + result.times.resampleMs};
}

/// Bisects the thickness of the layer until the mean opacity is a half.
double Bench::layerFor(const RayCaster& caster, const TransferFunction& function) const {
    double thin = 1e-6, thick = 10;  // over the longest side
    const Vec3d size = mesh_.boundsWorld().size();
    const double longest = std::max({size.x, size.y, size.z});
    for (int i = 0; i < 16; ++i) {
        const double layer = std::sqrt(thin * thick);
        const RgbaImage image = caster.draw(fewRays_, function, {.layerWorld = layer * longest}, execution_);
        (meanOpacity(image) > 0.5 ? thin : thick) = layer;
    }
    return thick * longest;
}

Row Bench::compare(const Made& all, int tenth) const {
    const TransferFunction function = tenthShown(range_, tenth, options_.rise);
    const Made visible = make(&function);
    RayCastOptions cast{.layerWorld = layerFor(all.caster, function), .stepVoxels = options_.stepVoxels};
    const RgbaImage whole = all.caster.draw(rays_, function, cast, execution_);
    const ImageDifference difference =
        differenceOf(whole, visible.caster.draw(rays_, function, cast, execution_));
    cast.stepVoxels /= 2;
    const ImageDifference step = differenceOf(whole, all.caster.draw(rays_, function, cast, execution_));
    const std::int64_t shown = shownPixels(whole), pixels = rays_.pixelCount();
    return {.low = function.stops.front().value,
            .high = function.stops.back().value,
            .voxels = visible.voxels,
            .share = double(visible.voxels) / double(all.voxels),
            .ms = visible.ms,
            .shown = double(shown) / double(pixels),
            .layerWorld = cast.layerWorld,
            .rms = 255 * difference.rms(pixels),
            .shownRms = 255 * difference.rms(shown),
            .largest = 255 * difference.largest,
            .step = 255 * step.rms(pixels)};
}

void Bench::run() const {
    std::ofstream csv;
    if (!options_.csvPath.empty()) {
        csv.open(options_.csvPath);
        if (!csv) throw IoError("can't write " + options_.csvPath);
        csv << kCsvHeading;
    }
    const Made all = make(nullptr);
    fmt::print("by error alone, {} % of the range: {} voxels, finest spacing {:.4g}, {:.0f} ms\n",
               options_.maxErrorPercent, all.voxels, all.finestWorld, all.ms);
    fmt::print("{} x {} pixels, {} see the mesh; opacity rises over {} of a tenth\n\n{}", options_.size,
               options_.size, rays_.pixelCount(), options_.rise, kHeading);
    int small = 0, alike = 0;
    for (int tenth = 0; tenth < kTenths; ++tenth) {
        const Row row = compare(all, tenth);
        small += row.share <= 0.35;
        alike += row.rms < 1;
        fmt::print("{}", text(tenth + 1, row));
        std::fflush(stdout);
        if (csv.is_open()) csv << csvText(tenth + 1, row);
    }
    fmt::print("\nat most 35 % of the voxels: {} of {}; under 1/255 RMS: {} of {}\n", small, kTenths, alike,
               kTenths);
    const TransferFunction nothing{"", {{0, {1, 1, 1}, 0}}};
    const Made unseen = make(&nothing);
    const BrickPlan coarsest(mesh_, chooseFrame(mesh_.boundsWorld(), refine_), execution_);
    fmt::print("opacity 0: {} voxels in {} bricks; the coarsest are {} bricks\n", unseen.voxels,
               unseen.bricks, coarsest.leafCount());
}

}  // namespace

int main(int count, char** words) {
    Options options;
    bench::Arguments arguments("What refinement by visibility spares, tenth by tenth of a field's range");
    arguments.add("mesh", options.meshPath, "a mesh file; without, a graded box");
    arguments.add("--field", options.field, "its name; without, the first");
    arguments.add("--max-error", options.maxErrorPercent, "percent of the field's range");
    arguments.add("--size", options.size, "pixels of the picture's side", {8, 8192});
    arguments.add("--rise", options.rise, "share of a tenth that the opacity rises over, 0 to 0.5");
    arguments.add("--step", options.stepVoxels, "of a ray, in voxels");
    arguments.add("--brick-size", options.brickCells, "");
    arguments.add("--algorithm", options.algorithm, "");
    arguments.add("--threads", options.threads, "");
    arguments.add("--csv", options.csvPath, "writes the table there, too");
    return arguments.run(count, words, [&] {
        const TetMesh mesh =
            options.meshPath.empty() ? gradedBox(100'000) : readMesh(options.meshPath, {}, {}).mesh;
        const int field = options.field.empty() ? 0 : mesh.findField(options.field);
        if (field < 0 || mesh.fields.empty()) throw InputError("no field " + options.field);
        if (!(options.rise >= 0 && options.rise <= 0.5)) throw InputError("--rise is a share from 0 to 0.5");
        Bench(options, mesh, field).run();
        return 0;
    });
}
