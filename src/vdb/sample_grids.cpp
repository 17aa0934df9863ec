#include "vdb/sample_grids.h"

#include <openvdb/io/File.h>
#include <openvdb/tools/Interpolation.h>

#include <algorithm>
#include <cmath>

#include "tessera/error.h"
#include "vdb/openvdb_grids.h"

namespace tessera {
namespace {

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

std::array<float, 3> numbers(float value) {
    return {value, 0, 0};
}
std::array<float, 3> numbers(const openvdb::Vec3f& value) {
    return {value[0], value[1], value[2]};
}

template <class Grid>
std::vector<GridReading> read(const openvdb::GridBase::Ptr& base, std::span<const GridPlace> places) {
    const typename Grid::Ptr grid = openvdb::gridPtrCast<Grid>(base);
    if (!grid) throw InputError("grid " + base->getName() + " holds other values than its name says");
    const auto accessor = grid->getConstAccessor();
    std::vector<GridReading> readings(places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
        const openvdb::Vec3d index = grid->transform().worldToIndex(openvdb::Vec3d(places[i].world.data()));
        const openvdb::Vec3d exact(places[i].exactIndex.data());
        const double moved = (index - exact).length();
        if (!(moved <= 1e9)) continue;  // a transform of another world
        if (!isComplete(accessor, index, moved)) continue;
        typename Grid::ValueType value, there;
        openvdb::tools::BoxSampler::sample(accessor, index, value);
        there = value;
        if (moved > kOnPlane) openvdb::tools::BoxSampler::sample(accessor, exact, there);
        readings[i] = {numbers(value), numbers(there), 1};
    }
    return readings;
}

}  // namespace

std::vector<std::vector<GridReading>> sampleGrids(const std::string& path,
                                                  std::span<const std::vector<GridPlace>> places,
                                                  std::span<const GridQuestion> questions) {
    openvdb::initialize();
    openvdb::io::File source(path);
    source.open(/*delayLoad=*/false);
    std::vector<std::vector<GridReading>> answers;
    for (const GridQuestion& question : questions) {
        std::vector<GridReading>& answer = answers.emplace_back();
        if (!source.hasGrid(question.grid)) continue;
        const openvdb::GridBase::Ptr grid = source.readGrid(question.grid);
        const std::vector<GridPlace>& asked = places[question.places];
        answer = question.components == 3 ? read<openvdb::Vec3SGrid>(grid, asked)
                                          : read<openvdb::FloatGrid>(grid, asked);
    }
    return answers;
}

}  // namespace tessera
