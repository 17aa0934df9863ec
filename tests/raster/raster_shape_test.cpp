// The rule by which a fragment accepts a lattice point, evaluated as the shaders do, against exact
// arithmetic.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "raster/prepared_region.h"
#include "raster/regions.h"
#include "raster_elements.h"
#include "reference/reference_block.h"

namespace tessera {
namespace {

using rastertest::rounds;
using rastertest::Zoo;

/// What ElementShape promises.
constexpr double kSpill = kLargestMargin;

struct Tally {
    std::int64_t contained = 0, beside = 0, easy = 0, thin = 0, hard = 0;
};

void checkPoint(const Vec3i& p, const IndexBox& box, std::int32_t element, const SliceElement& slice,
                const PreparedRegion& region, const ReferenceBlock& reference, Tally& tally) {
    const bool isEasy = slice.grade == ShapeGrade::easy;
    const auto [least, slack] = rastertest::fragmentOf(region, slice, p - box.min);
    const Vec3i q = p - box.min, n = box.size();
    const auto candidates = reference.candidatesOf(std::size_t((q.z * n.y + q.y) * n.x + q.x));
    const auto found = std::ranges::find(candidates, element, &Candidate::element);
    const bool isNear = found != candidates.end(), isIn = isNear && found->contains;
    const bool isAccepted = !(least < -slack);
    EXPECT_TRUE(isAccepted || !isIn) << "rejects a point of element " << element << ", distance " << least
                                     << ", slack " << slack << (isEasy ? ", easy" : ", thin");
    EXPECT_TRUE(isNear || !isAccepted) << "accepts a point beside element " << element << ", distance "
                                       << least << ", slack " << slack << (isEasy ? ", easy" : ", thin");
    if (isNear) {
        EXPECT_NEAR(least, found->depthVoxels, slack + 2e-8) << (isEasy ? "easy" : "thin");
    }
    tally.contained += isIn;
    tally.beside += isNear && !isIn;
}

void checkMesh(const TetMesh& mesh, const Lattice& lattice, const IndexBox& box, Tally& tally) {
    const NodeFrame frame = frameNodes(mesh, lattice, {});
    const Oracle oracle(mesh, lattice);
    const ReferenceBlock reference = referenceBlock(oracle, box, {.toleranceVoxels = kSpill});
    const rastertest::NumberedRegion numbered(mesh, frame, box, {});
    const PreparedRegion& region = numbered.region();
    tally.hard += std::int64_t(region.hard.size());
    // What has no record has no point in the region.
    for (const Candidate& candidate : reference.candidates) {
        EXPECT_TRUE(!candidate.contains || numbered.isHard(candidate.element) ||
                    numbered.find(candidate.element))
            << "element " << candidate.element << " is left out";
    }
    for (std::int32_t element = 0; element < mesh.elementCount(); ++element) {
        const SliceElement* slice = numbered.find(element);
        if (!slice) continue;
        ++(slice->grade == ShapeGrade::easy ? tally.easy : tally.thin);
        // Sprites hang over, so points beside the bounding box are asked for too.
        const IndexBox within = pointsAbout(shapeElement(mesh, frame, element), box);
        const int ring = slice->isSmall ? kSmallExtent : 1;
        const IndexBox about = intersect({within.min - ring, within.max + ring}, box);
        Vec3i p;
        for (p.z = about.min.z; p.z < about.max.z; ++p.z)
            for (p.y = about.min.y; p.y < about.max.y; ++p.y)
                for (p.x = about.min.x; p.x < about.max.x; ++p.x)
                    checkPoint(p, box, element, *slice, region, reference, tally);
        if (testing::Test::HasFailure()) return;
    }
}

const Lattice kUnit = Lattice::axisParallel({0, 0, 0}, 1);

class ShapesOf : public testing::TestWithParam<Zoo> {};

TEST_P(ShapesOf, AcceptEveryContainedPointAndNoneBesideByMoreThanTheBound) {
    Tally tally;
    std::uint64_t seed = 100'000 + 1000 * std::uint64_t(GetParam());
    for (const double size : {0x1p-12, 0.03, 0.5, 2.0, 7.0, 24.0, 100.0})
        for (int round = 0; round < rounds(3); ++round) {
            const IndexBox box{{-17, 3, -9}, {7, 27, 16}};
            const int count = size > 50 ? 60 : size > 10 ? 250 : 800;
            checkMesh(
                rastertest::zooMesh(GetParam(), count, ++seed, size, Vec3d(box.min) - 1.0, Vec3d(box.max)),
                kUnit, box, tally);
        }
    EXPECT_GT(tally.contained, 500);
    EXPECT_GT(tally.easy + tally.thin, 100);
}

TEST_P(ShapesOf, AreRightInElementsLongerThanCells) {
    Tally tally;
    std::uint64_t seed = 107'000 + 1000 * std::uint64_t(GetParam());
    for (const double size : {300.0, 900.0, 2500.0, 20000.0})
        for (int round = 0; round < rounds(2); ++round) {
            const IndexBox box{{240, -256, 500}, {256, -240, 512}};
            checkMesh(rastertest::zooMesh(GetParam(), 60, ++seed, size, Vec3d(box.min) - 1.0, Vec3d(box.max)),
                      kUnit, box, tally);
        }
    EXPECT_GT(tally.easy + tally.thin + tally.hard, 100);
}

TEST_P(ShapesOf, AreRightFarFromIndexZeroAndOnTurnedLattices) {
    Tally tally;
    const std::uint64_t seed = 117'000 + 1000 * std::uint64_t(GetParam());
    const TetMesh mesh = rastertest::zooMesh(GetParam(), 400, seed, 9, Vec3d(-1), Vec3d(20));
    const int away = 1'000'000'000;
    checkMesh(mesh, Lattice::axisParallel(Vec3d(-double(away)), 1), {Vec3i(away), Vec3i(away + 20)}, tally);
    const Lattice turned{{20, -3, 1}, {-0.6, 0.8, 0.1}, {0.8, 0.5, -0.2}, {0.1, 0.3, 1.9}};
    checkMesh(mesh, turned, {{-2, -2, -2}, {22, 22, 12}}, tally);
    EXPECT_GT(tally.contained, 5);
}

INSTANTIATE_TEST_SUITE_P(Zoo, ShapesOf, testing::ValuesIn(rastertest::kZoo),
                         [](const testing::TestParamInfo<Zoo>& param) {
                             return std::string(nameOf(param.param));
                         });

TetMesh oneElement(const std::array<Vec3d, 4>& nodes) {
    TetMesh mesh;
    mesh.points.assign(nodes.begin(), nodes.end());
    mesh.tets = {{0, 1, 2, 3}};
    return mesh;
}

ShapeGrade gradeOf(const std::array<Vec3d, 4>& nodes) {
    const TetMesh mesh = oneElement(nodes);
    return shapeElement(mesh, frameNodes(mesh, kUnit, {}), 0).grade;
}

TEST(ElementShape, OrdinaryElementsAreEasyAndFlatOnesHard) {
    for (const double size : {1e-3, 0.1, 1.0, 10.0, 100.0}) {
        EXPECT_EQ(gradeOf({Vec3d{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, size}}), ShapeGrade::easy)
            << size;
        EXPECT_EQ(gradeOf({Vec3d{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {size, size, 0}}), ShapeGrade::hard);
        EXPECT_EQ(gradeOf({Vec3d{0, 0, 0}, {size, 0, 0}, {size, 0, 0}, {size, size, 1}}), ShapeGrade::hard);
        EXPECT_EQ(gradeOf({Vec3d{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}}), ShapeGrade::hard);
    }
    EXPECT_EQ(gradeOf({Vec3d{0, 0, 0}, {3, 0, 0}, {0, 3, 0}, {1, 1, 1e-5}}), ShapeGrade::thin);
    // Higher than the depth buffer reaches.
    EXPECT_EQ(gradeOf({Vec3d{0, 0, 0}, {9000, 0, 0}, {0, 9000, 0}, {0, 0, 9000}}), ShapeGrade::hard);
}

TEST(ElementShape, DistancesAreThoseOfTheClosedForm) {
    const TetMesh mesh = oneElement({Vec3d{10, 20, 30}, {18, 20, 30}, {10, 28, 30}, {10, 20, 38}});
    const ElementShape shape = shapeElement(mesh, frameNodes(mesh, kUnit, {}), 0);
    EXPECT_EQ(shape.first, Vec3i(10, 20, 30));
    const double heights[4] = {8 / std::sqrt(3.0), 8, 8, 8};
    for (int face = 0; face < 4; ++face) {
        EXPECT_NEAR(shape.height[face], heights[face], 1e-14);
        double atOwnNode = shape.offset[face], atNext = shape.offset[face];
        for (int a = 0; a < 3; ++a) {
            atOwnNode += shape.normal[face][a] * shape.node[face][a];
            atNext += shape.normal[face][a] * shape.node[(face + 1) & 3][a];
        }
        EXPECT_NEAR(atOwnNode, heights[face], 1e-14);
        EXPECT_NEAR(atNext, 0, 1e-14);
    }
    EXPECT_EQ(pointsAbout(shape, {{0, 0, 0}, {100, 100, 100}}), (IndexBox{{10, 20, 30}, {19, 29, 39}}));
    EXPECT_EQ(pointsAbout(shape, {{0, 25, 0}, {12, 100, 100}}), (IndexBox{{10, 25, 30}, {12, 29, 39}}));
    EXPECT_TRUE(pointsAbout(shape, {{0, 0, 0}, {10, 100, 100}}).empty());
}

}  // namespace
}  // namespace tessera
