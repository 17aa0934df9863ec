// The arithmetic of vectors against that of single samples, bit by bit, on every instruction set there is.
#include "refine/measure_kernel.h"

#include <gtest/gtest.h>

#include <bit>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <vector>

#include "brick/seams.h"
#include "every_target.h"
#include "mesh/geometry.h"
#include "refine/error_samples.h"
#include "refine/sample_errors.h"

namespace tessera {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                 kInfinity = std::numeric_limits<double>::infinity();

std::uint64_t bitsOf(double value) {
    return std::bit_cast<std::uint64_t>(value);
}

class MeasureKernel : public testing::TestWithParam<int> {
  protected:
    MeasureKernel() { batch_->count = GetParam(); }
    double any(double low, double high) { return std::uniform_real_distribution(low, high)(random_); }
    std::size_t count() const { return std::size_t(batch_->count); }

    std::mt19937_64 random_{7};
    std::unique_ptr<MeasureBatch> batch_ = std::make_unique<MeasureBatch>();
};

TEST_P(MeasureKernel, PlacesElements) {
    TetMesh mesh;
    mesh.points = {{0.3, -2.5, 7.125}};
    const SampledMesh samples(mesh, {}, {});
    const Vec3d origin{-1.1, 0.7, 3.3};
    std::array<std::array<Vec3d, 4>, kMeasureLanes> nodes;
    for (auto& element : nodes) {
        const double scale = std::exp2(any(-60, 20));
        for (Vec3d& node : element) node = Vec3d(any(-1, 1), any(-1, 1), any(-1, 1)) * scale;
        if (any(0, 1) < 0.2) element[3] = element[any(0, 1) < 0.5 ? 2 : 1];  // flat
    }
    for (std::size_t i = 0; i < kMeasureLanes; ++i)
        for (std::size_t k = 0; k < 4; ++k)
            for (int a = 0; a < 3; ++a) batch_->node[k][i].number[std::size_t(a)] = nodes[i][k][a];
    for (auto& node : batch_->node)
        for (FourDoubles& quad : node) quad.number[3] = any(-5, 5);
    LaneDoubles means;
    onEveryTarget([&] {
        const ElementSigns signs = measure::placeElements(*batch_, samples.reference(), origin, means);
        EXPECT_EQ((signs.negative | signs.uncertain) & ~batch_->lanes(), 0u);
        for (std::size_t i = 0; i < count(); ++i) {
            const auto& [a, b, c, d] = nodes[i];
            const SixfoldVolume sixfold = sixfoldVolume(a, b, c, d);
            EXPECT_EQ(bitsOf(batch_->sixfold[i]), bitsOf(sixfold.value));
            const bool isCertain = std::abs(sixfold.value) > sixfold.errorBound;
            EXPECT_EQ(signs.uncertain >> i & 1, !isCertain);
            EXPECT_EQ(signs.negative >> i & 1, isCertain && sixfold.value < 0);
            EXPECT_EQ(bitsOf(batch_->volume[i]), bitsOf(elementVolume(sixfold.value)));
            const Vec3d place = samples.centroidWorld(a, b, c, d, origin);
            for (int axis = 0; axis < 3; ++axis)
                EXPECT_EQ(bitsOf(batch_->place[axis][i]), bitsOf(place[axis]));
            double sum = 0;
            for (const auto& node : batch_->node) sum += node[i].number[3];
            EXPECT_EQ(bitsOf(means[i]), bitsOf(0.25 * sum));
        }
    });
}

TEST_P(MeasureKernel, GathersAndPlacesNodes) {
    constexpr std::size_t kNodes = 200;
    std::vector<FourDoubles> nodes(kNodes);
    for (FourDoubles& node : nodes)
        for (double& number : node.number) number = any(-5, 5);
    for (auto& tet : batch_->tet)
        for (std::int32_t& node : tet) node = std::int32_t(any(0, kNodes));
    const Vec3d origin{-1.1, 0.7, 3.3};
    LaneDoubles values;
    onEveryTarget([&] {
        for (auto& node : batch_->node) std::fill(std::begin(node), std::end(node), FourDoubles{});
        measure::gatherNodes(*batch_, nodes.data());
        measure::placeNodes(*batch_, origin, values);
        for (std::size_t i = 0; i < count(); ++i) {
            for (std::size_t k = 0; k < 4; ++k)
                EXPECT_EQ(batch_->node[k][i].number, nodes[std::size_t(batch_->tet[i][k])].number);
            const auto& first = batch_->node[0][i].number;
            for (std::size_t a = 0; a < 3; ++a)
                EXPECT_EQ(bitsOf(batch_->place[a][i]), bitsOf(first[a] - origin[int(a)]));
            EXPECT_EQ(bitsOf(values[i]), bitsOf(first[3]));
        }
    });
}

/// Leaves of three levels: of root bricks (x, y, z) in [-1, 1]^3 one is absent and two are split.
BrickTree threeLevels() {
    std::vector<BrickKey> leaves;
    const auto isSplit = [](const BrickKey& key) {
        return (key.level == 2 && (key.index == Vec3i(0) || key.index == Vec3i(-1, 0, 1))) ||
               (key.level == 1 && key.index == Vec3i(1));
    };
    const std::function<void(const BrickKey&)> add = [&](const BrickKey& key) {
        if (!isSplit(key)) return leaves.push_back(key);
        for (int c = 0; c < 8; ++c) add({key.level - 1, key.index * 2 + cornerOffset(c)});
    };
    for (int x = -1; x <= 1; ++x)
        for (int y = -1; y <= 1; ++y)
            for (int z = -1; z <= 1; ++z)
                if (Vec3i(x, y, z) != Vec3i(1, 0, 0)) add({2, {x, y, z}});
    return BrickTree({0, 0, 0}, 0.3, 8, std::move(leaves));
}

TEST_P(MeasureKernel, FindsLeaves) {
    const BrickTree tree = threeLevels();
    const double spacing = tree.spacingWorld(0), edge = 32 * spacing, inverse = 1 / spacing;
    const Box3d bounds{Vec3d(-0.9 * edge), Vec3d(3 * edge)};
    for (std::size_t i = 0; i < kMeasureLanes; ++i) {
        const double kind = any(0, 1);
        for (auto& place : batch_->place)
            place[i] = kind < 0.3 ? spacing * std::round(any(-33, 65)) : any(-1.1 * edge, 2.1 * edge);
        if (kind > 0.97) batch_->place[1][i] = kind > 0.98 ? kNan : kind > 0.99 ? kInfinity : 1e30;
    }
    onEveryTarget([&] {
        const LaneBits found = measure::findLeaves(*batch_, tree.walk(), inverse, bounds);
        EXPECT_EQ(found & ~batch_->lanes(), 0u);
        for (std::size_t i = 0; i < count(); ++i) {
            const Vec3d place(batch_->place[0][i], batch_->place[1][i], batch_->place[2][i]);
            const std::int64_t leaf = contains(bounds, place) ? tree.findLeafAt(place * inverse) : -1;
            EXPECT_EQ(found >> i & 1, leaf >= 0);
            EXPECT_EQ(found >> i & 1 ? batch_->leaf[i] : -1, leaf);
        }
    });
}

TEST_P(MeasureKernel, LocatesCells) {
    constexpr int kBrick = 16, kEdge = 3;
    for (std::size_t i = 0; i < kMeasureLanes; ++i) {
        batch_->frame[i] = {{any(-100, 100), 0, 1e3, std::exp2(std::round(any(-3, 3)))}};
        for (int a = 0; a < 3; ++a) {
            const double whole = std::floor(any(-1, 18)), near = std::exp2(any(-60, -1));
            const int kind = int(any(0, 4));
            const double local = kind == 0   ? whole
                                 : kind == 1 ? whole - near
                                 : kind == 2 ? whole + near
                                             : any(0, 16);
            const auto& frame = batch_->frame[i].number;
            batch_->place[a][i] = (local + frame[std::size_t(a)]) / frame[3];
        }
    }
    onEveryTarget([&] {
        measure::locateCells(*batch_, kBrick, kEdge);
        for (std::size_t i = 0; i < count(); ++i) {
            Vec3d local;
            for (int a = 0; a < 3; ++a)
                local[a] = batch_->place[a][i] * batch_->frame[i].number[3] -
                           batch_->frame[i].number[std::size_t(a)];
            const CellPlace place = locateInBrick(local, kBrick);
            const Vec3i tile = place.cell / 8, in = place.cell - tile * 8;
            EXPECT_EQ(batch_->tile[i], (tile.x * kEdge + tile.y) * kEdge + tile.z);
            EXPECT_EQ(batch_->offset[i], offsetInTile(in));
            EXPECT_EQ(batch_->beyond[i], (in.x == 7) | (in.y == 7) << 1 | (in.z == 7) << 2);
            EXPECT_EQ(batch_->leastCell[i], std::min({place.cell.x, place.cell.y, place.cell.z}));
            for (int a = 0; a < 3; ++a) EXPECT_EQ(bitsOf(batch_->fraction[a][i]), bitsOf(place.fraction[a]));
        }
    });
}

TEST_P(MeasureKernel, FindsCorners) {
    constexpr int kLeaves = 5, kTiles = 8;
    std::vector<std::int64_t> tiles(kLeaves * kTiles);
    for (std::size_t t = 0; t < tiles.size(); ++t)
        tiles[t] = 0x7f0012345000 + 2048 * std::int64_t(t) + (t % 3 == 0);
    LaneBits lanes = 0;
    for (std::size_t i = 0; i < kMeasureLanes; ++i) {
        lanes |= LaneBits(i < count() && i % 4 != 1) << i;
        batch_->leaf[i] = i % 4 == 1 ? -1 : std::int32_t(any(0, kLeaves));
        batch_->tile[i] = std::int32_t(any(0, kTiles));
        batch_->offset[i] = std::int32_t(any(0, kTilePoints));
        batch_->beyond[i] = std::max(0, int(any(-8, 8)));
    }
    onEveryTarget([&] {
        const LaneBits found = measure::findCorners(*batch_, lanes, tiles.data(), kTiles);
        for (std::size_t i = 0; i < kMeasureLanes; ++i) {
            const bool isAsked = lanes >> i & 1;
            const std::int64_t tile =
                isAsked ? tiles[std::size_t(batch_->leaf[i] * kTiles + batch_->tile[i])] : 1;
            const bool isFound = tile % 2 == 0 && batch_->beyond[i] == 0;
            EXPECT_EQ(found >> i & 1, isFound);
            EXPECT_EQ(isFound ? batch_->corner[i] : 0, isFound ? tile + 4 * batch_->offset[i] : 0);
        }
    });
}

TEST_P(MeasureKernel, TakesErrors) {
    LaneCorners corners;
    LaneDoubles exact;
    for (std::size_t i = 0; i < kMeasureLanes; ++i) {
        for (auto& fraction : batch_->fraction)
            fraction[i] = any(0, 1) < 0.2 ? std::round(any(0, 1)) : any(0, 1);
        for (std::size_t c = 0; c < 8; ++c) corners.at(c, i) = float(any(-1e3, 1e3));
        if (any(0, 1) < 0.1) corners.at(3, i) = std::numeric_limits<float>::infinity();
        exact[i] = any(0, 1) < 0.1 ? kNan : any(-1e3, 1e3);
    }
    for (const bool isSquared : {false, true})
        onEveryTarget([&] {
            LaneDoubles errors{};
            batch_->kept = 0;
            for (std::size_t i = 0; i < count(); ++i) batch_->kept |= LaneBits(i % 5 != 0) << i;
            measure::addDifference(*batch_, corners, exact, isSquared, errors);
            measure::finishErrors(*batch_, isSquared, errors);
            LaneFloats listed;
            const double worst = measure::listErrors(*batch_, errors, 3, listed);
            double largest = -1;
            for (std::size_t i = 0; i < count(); ++i) {
                double value = 0;
                const Vec3d fraction(batch_->fraction[0][i], batch_->fraction[1][i], batch_->fraction[2][i]);
                for (int c = 0; c < 8; ++c)
                    value += cornerWeight(fraction, c) * double(corners.at(std::size_t(c), i));
                const double difference = value - exact[i];
                const double error = isSquared ? std::sqrt(difference * difference) : std::abs(difference);
                const bool isKept = i % 5 != 0 && std::isfinite(error);
                EXPECT_EQ(batch_->kept >> i & 1, isKept);
                EXPECT_EQ(listed[i], isKept ? float(error / 3) : -1.0f);
                if (!isKept) continue;
                EXPECT_EQ(bitsOf(errors[i]), bitsOf(error));
                largest = std::max(largest, error);
            }
            EXPECT_EQ(bitsOf(worst), bitsOf(largest));
        });
}

TEST_P(MeasureKernel, AddsUp) {
    LaneFloats listed;
    LaneDoubles values;
    for (std::size_t i = 0; i < kMeasureLanes; ++i) {
        const double kind = any(0, 1);
        listed[i] = kind < 0.1 ? float(kNan) : kind < 0.2 ? -1.0f : float(any(0, 2));
        values[i] = kind < 0.1 ? kInfinity : any(-5, 5);
        batch_->volume[i] = i < count() && kind < 0.9 ? any(0, 1) : 0;
    }
    std::array<WeightedSquares, kSumLanes> squares;
    std::array<double, kSumLanes> integral{};
    for (std::size_t i = 0; i < count(); ++i) {
        squares[i % kSumLanes].add(listed[i], 0.8 * batch_->volume[i]);
        if (std::isfinite(values[i])) integral[i % kSumLanes] += batch_->volume[i] * values[i];
    }
    onEveryTarget([&] {
        SquareSums sums;
        LaneSums integrals;
        measure::addSquares(*batch_, listed, 0.8, sums);
        measure::addIntegral(*batch_, values, integrals);
        for (std::size_t lane = 0; lane < kSumLanes; ++lane) {
            EXPECT_EQ(bitsOf(sums.squares.lane[lane]), bitsOf(squares[lane].sum));
            EXPECT_EQ(bitsOf(sums.weights.lane[lane]), bitsOf(squares[lane].weights));
            EXPECT_EQ(bitsOf(integrals.lane[lane]), bitsOf(integral[lane]));
        }
    });
}

TEST_P(MeasureKernel, AddsNodesUp) {
    constexpr std::size_t kNodes = 50;
    std::vector<float> listed(kNodes);
    for (float& error : listed)
        error = any(0, 1) < 0.2 ? -1.0f : any(0, 1) < 0.1 ? float(kNan) : float(any(0, 2));
    for (std::size_t i = 0; i < kMeasureLanes; ++i) {
        for (std::int32_t& node : batch_->tet[i]) node = std::int32_t(any(0, kNodes));
        batch_->volume[i] = i < count() && i % 7 != 0 ? any(0, 1) : 0;
    }
    std::array<WeightedSquares, kSumLanes> expected;
    for (std::size_t i = 0; i < count(); ++i)
        for (const std::int32_t node : batch_->tet[i])
            expected[i % kSumLanes].add(listed[std::size_t(node)], 0.05 * batch_->volume[i]);
    std::optional<SquareSums> first;
    onEveryTarget([&] {
        SquareSums sums;
        measure::addNodeSquares(*batch_, listed.data(), 0.05, sums);
        if (!first) first = sums;
        for (std::size_t lane = 0; lane < kSumLanes; ++lane) {
            EXPECT_NEAR(sums.squares.lane[lane], expected[lane].sum, 1e-14 * expected[lane].sum);
            EXPECT_NEAR(sums.weights.lane[lane], expected[lane].weights, 1e-14 * expected[lane].weights);
            EXPECT_EQ(bitsOf(sums.squares.lane[lane]), bitsOf(first->squares.lane[lane]));
            EXPECT_EQ(bitsOf(sums.weights.lane[lane]), bitsOf(first->weights.lane[lane]));
        }
    });
}

TEST(MeasureKernelValues, AddUpInEightSums) {
    std::mt19937_64 random(5);
    std::vector<float> values(512);
    for (float& value : values) value = std::uniform_real_distribution(-1e3f, 1e3f)(random);
    LaneSums expected;
    for (std::size_t i = 0; i < values.size(); ++i) expected.lane[i % kSumLanes] += double(values[i]);
    onEveryTarget([&] {
        LaneSums sums;
        measure::addValues(values.data(), values.size(), sums);
        for (std::size_t lane = 0; lane < kSumLanes; ++lane)
            EXPECT_EQ(bitsOf(sums.lane[lane]), bitsOf(expected.lane[lane]));
    });
}

INSTANTIATE_TEST_SUITE_P(Counts, MeasureKernel, testing::Values(1, 3, 8, 13, 63, 64),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace tessera
