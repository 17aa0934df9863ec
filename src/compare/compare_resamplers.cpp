#include "compare/compare_resamplers.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "base/parallel.h"
#include "base/timer.h"
#include "tessera/error.h"
#include "tessera/lattice.h"
#include "verify/voxel_mesh.h"

namespace tessera {

namespace {

/// The blocks of all contestants for one box at a time, and what they give.
class Comparison {
  public:
    Comparison(const TetMesh& mesh, std::span<const int> fields, const SamplingGrid& grid,
               const CompareOptions& options, const Execution& execution, CompareReport& report)
        : options_(options),
          execution_(execution),
          report_(report),
          voxels_(mesh, grid.lattice, execution.threadCount()),
          checker_(mesh, voxels_, fields, options.boundaryVoxels) {
        for (const ContestantReport& c : report.contestants)
            bounds_.push_back({c.spillVoxels, c.placeVoxels, c.format, {}, false});
        report.pairs.resize(report.contestants.size() - 1);
        for (std::size_t p = 0; p < report.pairs.size(); ++p)
            meters_.emplace_back(mesh, fields, options.thinVoxels);
        checks_.resize(report.contestants.size());
    }

    void addBox(std::span<const Block> blocks) {
        checker_.check(blocks, bounds_, checks_, thinnest_, execution_);
        for (std::size_t p = 0; p < meters_.size(); ++p) {
            meters_[p].add(blocks[0], blocks[p + 1], thinnest_);
            compareCoverage(blocks[0], blocks[p + 1], report_.pairs[p]);
        }
    }

    void finish() {
        for (std::size_t c = 0; c < checks_.size(); ++c) report_.contestants[c].check = checks_[c];
        for (std::size_t p = 0; p < meters_.size(); ++p)
            for (const FieldDifference& d : meters_[p].differences()) {
                ValueDifference value{d};
                value.worstWorld = report_.grid.lattice.worldFromIndex(Vec3d(d.worst));
                const VoxelMesh::Neighbour there =
                    voxels_.thinnestNear(Vec3d(d.worst), options_.boundaryVoxels);
                value.worstElement = there.element;
                value.worstThicknessVoxels = there.element >= 0 ? there.thicknessVoxels : 0;
                report_.pairs[p].fields.push_back(std::move(value));
            }
    }

  private:
    void compareCoverage(const Block& first, const Block& second, PairReport& pair) const {
        std::vector<Vec3i> differing;
        std::size_t at = 0;
        Vec3i p;
        for (p.z = first.box.min.z; p.z < first.box.max.z; ++p.z)
            for (p.y = first.box.min.y; p.y < first.box.max.y; ++p.y)
                for (p.x = first.box.min.x; p.x < first.box.max.x; ++p.x, ++at) {
                    const bool a = first.coverage[at] != 0, b = second.coverage[at] != 0;
                    pair.coveredByBoth += a && b;
                    pair.onlyFirst += a && !b;
                    pair.onlySecond += b && !a;
                    if (a != b) differing.push_back(p);
                }
        std::vector<std::uint8_t> isNear(differing.size());
        parallelFor(execution_, std::int64_t(differing.size()), [&](std::int64_t i) {
            const auto k = std::size_t(i);
            isNear[k] = voxels_.isNearBoundary(Vec3d(differing[k]), options_.boundaryVoxels);
        });
        for (std::size_t i = 0; i < differing.size(); ++i) {
            if (!isNear[i] && pair.awayFromBoundary == 0) pair.firstAway = differing[i];
            ++(isNear[i] ? pair.nearBoundary : pair.awayFromBoundary);
        }
    }

    const CompareOptions& options_;
    const Execution& execution_;
    CompareReport& report_;
    VoxelMesh voxels_;
    PointChecker checker_;
    std::vector<SampleBounds> bounds_;
    std::vector<PointCheck> checks_;
    std::vector<DifferenceMeter> meters_;
    std::vector<float> thinnest_;
};

}  // namespace

bool CompareReport::agrees() const {
    return std::all_of(contestants.begin(), contestants.end(),
                       [](const ContestantReport& c) { return c.check.isGood(); }) &&
           std::all_of(pairs.begin(), pairs.end(),
                       [](const PairReport& p) { return p.awayFromBoundary == 0; });
}

CompareReport compareResamplers(const TetMesh& mesh, std::span<const int> fields,
                                std::span<const Contestant> contestants, const SamplingGrid& grid,
                                const CompareOptions& options, const Execution& execution) {
    if (contestants.empty()) throw InputError("there is no algorithm to compare");
    CompareReport report;
    report.grid = grid;
    const std::vector<IndexBox> boxes = cutIntoBoxes(grid.points, options.boxEdge);
    report.boxes = boxes.size();
    std::vector<std::unique_ptr<BoundResampler>> bound;
    const Execution quiet = execution.withoutProgress();
    for (const Contestant& c : contestants) {
        execution.report(Stage::sampling, std::int64_t(bound.size()), std::int64_t(contestants.size()));
        Timer timer;
        bound.push_back(c.resampler->bind(mesh, fields, c.options));
        ContestantReport result;
        result.bindMs = timer.elapsedMs();
        result.label = c.label;
        result.target = bound.back()->target();
        result.format = c.options.format;
        result.meetsContract = c.resampler->info().meetsContract;
        result.spillVoxels = c.resampler->info().spillBoundVoxels;
        result.placeVoxels = c.resampler->info().placeBoundVoxels;
        result.times = timeRuns(*bound.back(), grid.lattice, boxes, options.runs, quiet);
        report.contestants.push_back(std::move(result));
    }
    Comparison comparison(mesh, fields, grid, options, execution, report);
    std::vector<Block> blocks(contestants.size());
    for (std::size_t b = 0; b < boxes.size(); ++b) {
        for (std::size_t c = 0; c < bound.size(); ++c)
            bound[c]->resample(
                grid.lattice, std::span(&boxes[b], 1),
                [&](std::size_t, const Block& block) { blocks[c] = block; }, quiet);
        comparison.addBox(blocks);
        execution.report(Stage::comparing, std::int64_t(b + 1), std::int64_t(boxes.size()));
    }
    comparison.finish();
    return report;
}

}  // namespace tessera
