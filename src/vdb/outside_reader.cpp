#include "vdb/outside_reader.h"

#include <openvdb/io/File.h>
#include <openvdb/tools/Interpolation.h>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "base/parallel.h"
#include "base/text.h"
#include "brick/leaf_tiles.h"
#include "refine/error_samples.h"
#include "vdb/openvdb_grids.h"
#include "vdb/vdb_metadata.h"

namespace tessera {
namespace {

constexpr std::int64_t kChunk = 4096;
constexpr double kOnPlane = 0x1p-20;  // voxels: what rounding in the transform may move a place by

// Whether the eight voxels around an index are active, but for those without weight.
// @param rounding how far the transform moved it from its place, in voxels.
template <class Accessor>
bool isComplete(const Accessor& accessor, const openvdb::Vec3d& index, double rounding) {
    const double onPlane = std::max(kOnPlane, 2 * rounding);
    openvdb::Vec3d base;
    openvdb::Vec3d fraction;
    for (int a = 0; a < 3; ++a) {
        const double whole = std::round(index[a]);
        base[a] = std::abs(index[a] - whole) < onPlane ? whole : std::floor(index[a]);
        fraction[a] = std::max(0.0, index[a] - base[a]);
        if (fraction[a] < onPlane) fraction[a] = 0;
    }
    for (int c = 0; c < 8; ++c) {
        if (((c & 1) && fraction[0] == 0) || ((c & 2) && fraction[1] == 0) || ((c & 4) && fraction[2] == 0))
            continue;
        const openvdb::Coord at(int(base[0]) + (c & 1), int(base[1]) + (c >> 1 & 1), int(base[2]) + (c >> 2));
        if (!accessor.isValueOn(at)) return false;
    }
    return true;
}

class OutsideReader {
  public:
    OutsideReader(const std::string& path, const VdbFile& file, const TetMesh& mesh,
                  std::span<const int> fields, const Execution& execution)
        : path_(path), file_(file), samples_(mesh, fields, execution), execution_(execution) {}

    OutsideReading run() {
        findPlaces();
        OutsideReading reading;
        for (const std::int32_t level : level_) reading.places += level >= 0;
        openvdb::initialize();
        openvdb::io::File source(path_);
        source.open(/*delayLoad=*/false);
        std::size_t f = 0;
        for (const OutputField& field : file_.fields) {
            squares_.assign(level_.size(), 0.0);
            movedSquares_.assign(level_.size(), 0.0);
            for (const GridPlan& plan : planGrids({field})) {
                for (int level = 0; level < file_.tree.levelCount(); ++level) {
                    const std::string name = gridName(plan.name, file_.layout, level);
                    if (!source.hasGrid(name)) continue;
                    const openvdb::GridBase::Ptr grid = source.readGrid(name);
                    if (plan.components == 3)
                        read(*openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid), f, plan, level, reading);
                    else
                        read(*openvdb::gridPtrCast<openvdb::FloatGrid>(grid), f, plan, level, reading);
                }
            }
            reading.max.push_back(largestRoot(squares_));
            reading.rounding.push_back(largestRoot(movedSquares_));
            ++f;
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
    openvdb::Vec3d exactIndex(std::size_t sample, int level) const {
        const Vec3d index = samples_.placeWorld(sample, file_.tree.originWorld()) /
                            file_.tree.spacingWorld() * std::ldexp(1.0, -level);
        return {index.x, index.y, index.z};
    }

    void findPlaces() {
        const ErrorSamples exact(samples_.mesh(), {}, execution_);
        const BrickTree& tree = file_.tree;
        std::vector<std::uint8_t> coarserNear(tree.leafCount());
        for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf)
            coarserNear[leaf] = hasCoarserNeighbour(tree, leaf);
        level_.assign(samples_.count(), -1);
        incomplete_.assign(samples_.count(), 0);
        parallelForChunks(execution_, std::int64_t(samples_.count()), kChunk,
                          [&](std::int64_t begin, std::int64_t end) {
                              for (std::int64_t i = begin; i < end; ++i)
                                  if (exact.exists(std::size_t(i)))
                                      level_[std::size_t(i)] = levelOf(std::size_t(i), coarserNear);
                          });
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

    template <class Grid>
    void read(const Grid& grid, std::size_t f, const GridPlan& plan, int level, OutsideReading& reading) {
        std::mutex mutex;
        const SampledField& field = samples_.fields()[f];
        // Where a field has values that aren't finite, so may the voxels around have none.
        const bool isFinite = std::all_of(field.field->values.begin(), field.field->values.end(),
                                          [](double value) { return std::isfinite(float(value)); });
        const double shift = file_.voxelShift * file_.tree.spacingWorld(level);
        parallelForChunks(
            execution_, std::int64_t(level_.size()), kChunk, [&](std::int64_t begin, std::int64_t end) {
                const auto accessor = grid.getConstAccessor();
                for (std::size_t i = std::size_t(begin); i < std::size_t(end); ++i) {
                    if (level_[i] != level || (field.isCell() && i < samples_.nodeCount())) continue;
                    const Vec3d world = samples_.placeWorld(i, Vec3d(0)) + shift;
                    const Vec3d place = world * file_.unitScale;
                    const openvdb::Vec3d index = grid.transform().worldToIndex(
                        turned(openvdb::Vec3d(place.x, place.y, place.z), file_.upAxis));
                    const openvdb::Vec3d exact = exactIndex(i, level);
                    const double moved = (index - exact).length();
                    if (!isComplete(accessor, index, moved)) {
                        squares_[i] = -1;
                        if (!isFinite) continue;
                        incomplete_[i] = 1;
                        const std::lock_guard lock(mutex);
                        if (reading.firstProblem.empty())
                            reading.firstProblem = "the place (" + exactText(world.x) + ", " +
                                                   exactText(world.y) + ", " + exactText(world.z) +
                                                   ") lacks voxels around it in grid " + grid.getName();
                        continue;
                    }
                    typename Grid::ValueType value;
                    openvdb::tools::BoxSampler::sample(accessor, index, value);
                    add(i, field, plan, value);
                    if (moved <= kOnPlane) continue;
                    typename Grid::ValueType there;
                    openvdb::tools::BoxSampler::sample(accessor, exact, there);
                    addMoved(i, value, there);
                }
            });
    }

    void add(std::size_t i, const SampledField& field, const GridPlan& plan, float value) {
        const int c =
            plan.firstChannel - file_.fields[std::size_t(&field - samples_.fields().data())].firstChannel;
        addComponent(i, field, c, double(value));
    }
    void add(std::size_t i, const SampledField& field, const GridPlan&, const openvdb::Vec3f& value) {
        const openvdb::Vec3f v = turnedBack(value, file_.upAxis);
        for (int c = 0; c < 3; ++c) addComponent(i, field, c, double(v[c]));
    }
    void addMoved(std::size_t i, float value, float exact) {
        const double difference = double(value) - double(exact);
        if (std::isfinite(difference)) movedSquares_[i] += difference * difference;
    }
    void addMoved(std::size_t i, const openvdb::Vec3f& value, const openvdb::Vec3f& exact) {
        for (int c = 0; c < 3; ++c) addMoved(i, value[c], exact[c]);
    }
    void addComponent(std::size_t i, const SampledField& field, int component, double value) {
        if (squares_[i] < 0) return;
        const double difference = value - samples_.exactValue(i, *field.field, component);
        if (std::isfinite(difference))
            squares_[i] += difference * difference;
        else
            squares_[i] = -1;
    }

    const std::string& path_;
    const VdbFile& file_;
    SampledMesh samples_;
    const Execution& execution_;
    std::vector<std::int32_t> level_;       // by sample: the level whose grid it is read from, or -1
    std::vector<std::uint8_t> incomplete_;  // by sample: it lacks a voxel in some grid
    std::vector<double> squares_;  // by sample: of the differences of one field; below 0 where not finite
    std::vector<double> movedSquares_;  // by sample: of what the transform's rounding changes of one field
};

}  // namespace

OutsideReading readAsOutsider(const std::string& path, const VdbFile& file, const TetMesh& mesh,
                              std::span<const int> fields, const Execution& execution) {
    return OutsideReader(path, file, mesh, fields, execution).run();
}

}  // namespace tessera
