#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "brick/growing_tree.h"
#include "brick/seams.h"
#include "pool/pool_on_device.h"

namespace tessera {

/// How far values interpolated on both sides of faces between bricks are apart.
struct FaceSteps {
    double texels = 0;  ///< of the pool: the largest step, in roundings of its format
    double values = 0;  ///< of what was published: the largest step, in ulp of a float
    std::int64_t places = 0;
    std::int64_t acrossDepths = 0;  ///< places between leaves of different depths
};

/// The rounding of a format's codes; of r32f, whose codes are values, 4 ulp.
inline double roundingOf(SampleFormat format, double largest) {
    switch (format) {
        case SampleFormat::r32f:
            return 4 * (double(std::nextafter(float(largest), INFINITY)) - double(float(largest)));
        case SampleFormat::r16f:
            return 0x1p-11;
        case SampleFormat::r16:
            return 1 / 65535.0;
        case SampleFormat::r8:
            return 1 / 255.0;
    }
    return 0;
}

/// Trilinear interpolation of what `at(point of the brick)` gives; `largest` receives the largest of them.
template <class At>
double interpolateInBrick(const Vec3d& local, int cells, double& largest, At&& at) {
    const CellPlace place = locateInBrick(local, cells);
    double sum = 0;
    for (int c = 0; c < 8; ++c) {
        const double weight = cornerWeight(place.fraction, c);
        if (weight == 0) continue;
        const double value = at(place.cell + cornerOffset(c));
        sum += weight * value;
        largest = std::max(largest, std::abs(value));
    }
    return sum;
}

/// At random points on faces of the leaves shown. @param channels those to look at.
inline FaceSteps stepsOnFaces(const BrickPool& pool, const PoolTarget& target, const GrowingTree& tree,
                              const std::vector<int>& channels, std::mt19937& random, int placesALeaf) {
    const auto state = pool.state();
    const PoolOnDevice device(pool, *state);
    const ShownBricks& bricks = target.bricks();
    const int cells = bricks.brickCells(), edge = cells + 1;
    const auto channelCount = std::size_t(bricks.channels());
    const std::vector<GrowingLeaf> leaves = tree.leaves();
    std::map<std::uint32_t, PointValues> published;  // by GrowingLeaf::slot
    for (const GrowingLeaf& leaf : leaves)
        published[leaf.slot] = bricks.valuesAt(leaf, bricks.closedPoints(leaf.key));
    // What both hold at a place of a leaf.
    const auto texelsAt = [&](const GrowingLeaf& leaf, int channel, const Vec3d& local, double& largest) {
        const std::uint32_t slot = *target.slotOf(leaf);
        return interpolateInBrick(local, cells, largest,
                                  [&](const Vec3i& p) { return device.code(slot, channel, p); });
    };
    const auto valuesAt = [&](const GrowingLeaf& leaf, int channel, const Vec3d& local, double& largest) {
        const PointValues& of = published.at(leaf.slot);
        return interpolateInBrick(local, cells, largest, [&](const Vec3i& p) {
            return of
                .values[std::size_t((p.z * edge + p.y) * edge + p.x) * channelCount + std::size_t(channel)];
        });
    };
    std::uniform_real_distribution<double> share(0, 1);
    FaceSteps steps;
    for (const GrowingLeaf& leaf : leaves)
        for (int i = 0; i < placesALeaf; ++i) {
            const int axis = int(random() % 3), side = int(random() % 2);
            Vec3i beside = leaf.key.index;
            beside[axis] += side ? 1 : -1;
            const auto other = tree.findCovering({leaf.key.depth, beside});
            if (!other) continue;
            Vec3d local;
            for (int a = 0; a < 3; ++a) local[a] = a == axis ? side * cells : cells * share(random);
            const Vec3d place = Vec3d(leaf.key.index * cells) + local;  // in this depth's voxels
            const int apart = leaf.key.depth - other->key.depth;
            const Vec3d there = place * std::ldexp(1.0, -apart) - Vec3d(other->key.index * cells);
            ++steps.places;
            steps.acrossDepths += apart != 0;
            for (const int channel : channels) {
                const auto stepOf = [&](auto&& at, double& largest) {
                    const double here = at(leaf, channel, local, largest);
                    const double beyond = at(*other, channel, there, largest);
                    if (std::isfinite(here) != std::isfinite(beyond)) return double(INFINITY);
                    return std::isfinite(here) ? std::abs(here - beyond) : 0.0;
                };
                double code = 0, value = 0;
                const double texelStep = stepOf(texelsAt, code), valueStep = stepOf(valuesAt, value);
                // A value that isn't finite has the code 0 and stands as it is in what was published, on both
                // sides or on none.
                steps.texels = std::max(steps.texels, texelStep / roundingOf(pool.coding().format(), code));
                if (valueStep > 0)
                    steps.values =
                        std::max(steps.values, 4 * valueStep / roundingOf(SampleFormat::r32f, value));
            }
        }
    return steps;
}

}  // namespace tessera
