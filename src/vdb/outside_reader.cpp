#include "vdb/outside_reader.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "base/text.h"
#include "brick/leaf_tiles.h"
#include "refine/error_samples.h"
#include "vdb/openvdb_grids.h"
#include "vdb/vdb_metadata.h"

namespace tessera {
namespace {

constexpr std::int64_t kChunk = 4096;

class OutsideReader {
  public:
    OutsideReader(const VdbFile& file, const TetMesh& mesh, std::span<const int> fields,
                  const Execution& execution)
        : file_(file), samples_(mesh, fields, execution), execution_(execution) {}

    OutsideReading run(const std::string& path, const GridSampler& sampler) {
        findPlaces();
        OutsideReading reading;
        for (const std::vector<std::size_t>& level : samplesOfLevel_)
            reading.places += std::int64_t(level.size());
        for (std::size_t f = 0; f < file_.fields.size(); ++f) {
            squares_.assign(samples_.count(), 0.0);
            movedSquares_.assign(samples_.count(), 0.0);
            const std::vector<GridPlan> plans = planGrids({file_.fields[f]});
            std::vector<GridQuestion> questions;
            for (const GridPlan& plan : plans)
                for (std::size_t level = 0; level < places_.size(); ++level)
                    if (!places_[level].empty())
                        questions.push_back(
                            {gridName(plan.name, file_.layout, int(level)), plan.components, level});
            const std::vector<std::vector<GridReading>> answers = sampler(path, places_, questions);
            std::size_t q = 0;
            for (const GridPlan& plan : plans)
                for (std::size_t level = 0; level < places_.size(); ++level)
                    if (!places_[level].empty()) {
                        add(f, plan, questions[q], answers[q], reading);
                        ++q;
                    }
            reading.max.push_back(largestRoot(squares_));
            reading.rounding.push_back(largestRoot(movedSquares_));
        }
        reading.incomplete = std::count(incomplete_.begin(), incomplete_.end(), std::uint8_t(1));
        return reading;
    }

  private:
    static double largestRoot(const std::vector<double>& squares) {
        double largest = 0;
        for (const double square : squares) largest = std::max(largest, square);
        return std::sqrt(largest);
    }

    // Where the transform would place a sample in the grid of its level if it were exact. A turned grid has
    // turned places, not indices.
    Vec3d exactIndex(std::size_t sample, int level) const {
        return samples_.placeWorld(sample, file_.tree.originWorld()) / file_.tree.spacingWorld() *
               std::ldexp(1.0, -level);
    }
    // Where the grids of a level have a sample, in units of the mesh.
    Vec3d shiftedWorld(std::size_t sample, std::size_t level) const {
        return samples_.placeWorld(sample, Vec3d(0)) + file_.voxelShift * file_.tree.spacingWorld(int(level));
    }

    void findPlaces() {
        const ErrorSamples exact(samples_.mesh(), {}, execution_);
        const BrickTree& tree = file_.tree;
        std::vector<std::uint8_t> coarserNear(tree.leafCount());
        for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf)
            coarserNear[leaf] = hasCoarserNeighbour(tree, leaf);
        std::vector<std::int32_t> levels(samples_.count(), -1);
        incomplete_.assign(samples_.count(), 0);
        parallelForChunks(execution_, std::int64_t(samples_.count()), kChunk,
                          [&](std::int64_t begin, std::int64_t end) {
                              for (std::int64_t i = begin; i < end; ++i)
                                  if (exact.exists(std::size_t(i)))
                                      levels[std::size_t(i)] = levelOf(std::size_t(i), coarserNear);
                          });
        samplesOfLevel_.resize(std::size_t(std::max(tree.levelCount(), 1)));
        for (std::size_t i = 0; i < levels.size(); ++i)
            if (levels[i] >= 0) samplesOfLevel_[std::size_t(levels[i])].push_back(i);
        places_.resize(samplesOfLevel_.size());
        for (std::size_t level = 0; level < places_.size(); ++level)
            for (const std::size_t i : samplesOfLevel_[level]) {
                const Vec3d world = turned(shiftedWorld(i, level) * file_.unitScale, file_.upAxis);
                const Vec3d index = exactIndex(i, int(level));
                places_[level].push_back({{world.x, world.y, world.z}, {index.x, index.y, index.z}});
            }
    }

    std::int32_t levelOf(std::size_t sample, const std::vector<std::uint8_t>& coarserNear) const {
        const BrickTree& tree = file_.tree;
        if (file_.boundsWorld && !contains(*file_.boundsWorld, samples_.placeWorld(sample, Vec3d(0))))
            return -1;
        const Vec3d index0 = samples_.placeWorld(sample, tree.originWorld()) / tree.spacingWorld();
        const std::int32_t leaf = leafOfPlace(tree, index0);
        if (leaf < 0) return file_.layout == VdbLayout::flat ? 0 : -1;
        if (file_.layout == VdbLayout::flat) return 0;
        const BrickKey& key = tree.leaves()[std::size_t(leaf)];
        const Vec3d index = index0 * std::ldexp(1.0, -key.level);
        const CellPlace place =
            locateInBrick(index - Vec3d(key.index * tree.brickCells()), tree.brickCells());
        const int low = coarserNear[std::size_t(leaf)] ? 1 : 0;
        for (int a = 0; a < 3; ++a)
            if (place.cell[a] < low || place.cell[a] + 1 >= tree.brickCells()) return -1;
        if (file_.layers > 0) return key.level;
        // Without an extension a place is read where all eight voxels are samples.
        for (int c = 0; c < 8; ++c) {
            bool covered = false;
            file_.store.value(std::size_t(leaf), place.cell + cornerOffset(c), 0, covered);
            if (!covered && cornerWeight(place.fraction, c) > 0) return -1;
        }
        return key.level;
    }

    void add(std::size_t f, const GridPlan& plan, const GridQuestion& question,
             const std::vector<GridReading>& answer, OutsideReading& reading) {
        const SampledField& field = samples_.fields()[f];
        // Where a field has values that aren't finite, so may the voxels around have none.
        const bool isFinite = std::all_of(field.field->values.begin(), field.field->values.end(),
                                          [](double value) { return std::isfinite(float(value)); });
        const int first = plan.firstChannel - file_.fields[f].firstChannel;
        for (std::size_t k = 0; k < answer.size(); ++k) {
            const std::size_t i = samplesOfLevel_[question.places][k];
            if (field.isCell() && i < samples_.nodeCount()) continue;
            if (answer[k].isComplete == 0) {
                squares_[i] = -1;
                if (!isFinite) continue;
                incomplete_[i] = 1;
                if (!reading.firstProblem.empty()) continue;
                const Vec3d world = shiftedWorld(i, question.places);
                reading.firstProblem = "the place (" + exactText(world.x) + ", " + exactText(world.y) + ", " +
                                       exactText(world.z) + ") lacks voxels around it in grid " +
                                       question.grid;
                continue;
            }
            const Vec3d value = inMeshAxes(answer[k].value, plan);
            const Vec3d there = inMeshAxes(answer[k].atExactIndex, plan);
            for (int c = 0; c < plan.components; ++c) {
                addComponent(i, field, first + c, value[c]);
                if (const double moved = value[c] - there[c]; std::isfinite(moved))
                    movedSquares_[i] += moved * moved;
            }
        }
    }

    Vec3d inMeshAxes(const std::array<float, 3>& value, const GridPlan& plan) const {
        const Vec3d v{double(value[0]), double(value[1]), double(value[2])};
        return plan.components == 3 ? turnedBack(v, file_.upAxis) : v;
    }

    void addComponent(std::size_t i, const SampledField& field, int component, double value) {
        if (squares_[i] < 0) return;
        const double difference = value - samples_.exactValue(i, *field.field, component);
        if (std::isfinite(difference))
            squares_[i] += difference * difference;
        else
            squares_[i] = -1;
    }

    const VdbFile& file_;
    SampledMesh samples_;
    const Execution& execution_;
    std::vector<std::vector<std::size_t>> samplesOfLevel_;  // those that are read from its grids
    std::vector<std::vector<GridPlace>> places_;            // of these
    std::vector<std::uint8_t> incomplete_;                  // by sample: it lacks a voxel in some grid
    std::vector<double> squares_;  // by sample: of the differences of one field; below 0 where not finite
    std::vector<double> movedSquares_;  // by sample: of what the transform's rounding changes of one field
};

}  // namespace

OutsideReading readAsOutsider(const std::string& path, const VdbFile& file, const TetMesh& mesh,
                              std::span<const int> fields, const GridSampler& sampler,
                              const Execution& execution) {
    return OutsideReader(file, mesh, fields, execution).run(path, sampler);
}

}  // namespace tessera
