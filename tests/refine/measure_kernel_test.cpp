// The arithmetic of vectors against that of single samples, bit by bit, on every instruction set there is.
#include "refine/measure_kernel.h"

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <bit>
#include <cstring>
#include <limits>
#include <random>

#include "brick/seams.h"
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

/// Calls check() for each instruction set.
template <class Check>
void onEveryTarget(const Check& check) {
    for (const auto target : hwy::SupportedAndGeneratedTargets()) {
        SCOPED_TRACE(hwy::TargetName(target));
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        check();
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
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
            for (int a = 0; a < 3; ++a) batch_->nodeWorld[k][a][i] = nodes[i][k][a];
    onEveryTarget([&] {
        measure::placeElements(*batch_, samples.reference(), origin);
        for (std::size_t i = 0; i < count(); ++i) {
            const auto& [a, b, c, d] = nodes[i];
            const SixfoldVolume sixfold = sixfoldVolume(a, b, c, d);
            EXPECT_EQ(bitsOf(batch_->sixfold[i]), bitsOf(sixfold.value));
            EXPECT_EQ(batch_->isCertain[i] > 0, std::abs(sixfold.value) > sixfold.errorBound);
            EXPECT_EQ(bitsOf(batch_->volume[i]), bitsOf(elementVolume(sixfold.value)));
            const Vec3d place = samples.centroidWorld(a, b, c, d, origin);
            for (int axis = 0; axis < 3; ++axis)
                EXPECT_EQ(bitsOf(batch_->place[axis][i]), bitsOf(place[axis]));
        }
    });
}

TEST_P(MeasureKernel, LocatesCells) {
    constexpr int kBrick = 16, kEdge = 3;
    for (std::size_t i = 0; i < kMeasureLanes; ++i)
        for (int a = 0; a < 3; ++a) {
            const double whole = std::floor(any(-1, 18)), near = std::exp2(any(-60, -1));
            const int kind = int(any(0, 4));
            batch_->local[a][i] = kind == 0   ? whole
                                  : kind == 1 ? whole - near
                                  : kind == 2 ? whole + near
                                              : any(0, 16);
        }
    onEveryTarget([&] {
        measure::locateCells(*batch_, kBrick, kEdge);
        for (std::size_t i = 0; i < count(); ++i) {
            const Vec3d local(batch_->local[0][i], batch_->local[1][i], batch_->local[2][i]);
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

TEST_P(MeasureKernel, TakesErrors) {
    LaneFloats corners[8];
    LaneDoubles exact;
    for (std::size_t i = 0; i < kMeasureLanes; ++i) {
        for (auto& fraction : batch_->fraction)
            fraction[i] = any(0, 1) < 0.2 ? std::round(any(0, 1)) : any(0, 1);
        for (LaneFloats& corner : corners) corner[i] = float(any(-1e3, 1e3));
        if (any(0, 1) < 0.1) corners[3][i] = std::numeric_limits<float>::infinity();
        exact[i] = any(0, 1) < 0.1 ? kNan : any(-1e3, 1e3);
    }
    for (const bool isSquared : {false, true})
        onEveryTarget([&] {
            LaneDoubles errors{};
            for (std::size_t i = 0; i < kMeasureLanes; ++i) batch_->isKept[i] = i < count() && i % 5 != 0;
            measure::addDifference(*batch_, corners, exact, isSquared, errors);
            measure::finishErrors(*batch_, isSquared, errors);
            LaneFloats listed;
            const double worst = measure::listErrors(*batch_, errors, 3, listed);
            double largest = -1;
            for (std::size_t i = 0; i < count(); ++i) {
                double value = 0;
                const Vec3d fraction(batch_->fraction[0][i], batch_->fraction[1][i], batch_->fraction[2][i]);
                for (int c = 0; c < 8; ++c) value += cornerWeight(fraction, c) * double(corners[c][i]);
                const double difference = value - exact[i];
                const double error = isSquared ? std::sqrt(difference * difference) : std::abs(difference);
                const bool isKept = i % 5 != 0 && std::isfinite(error);
                EXPECT_EQ(batch_->isKept[i] > 0, isKept);
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

INSTANTIATE_TEST_SUITE_P(Counts, MeasureKernel, testing::Values(1, 3, 8, 13, 63, 64),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace tessera
