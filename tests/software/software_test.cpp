// What the contract suite can't see from outside: node places, ownership depth, element lists.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "every_target.h"
#include "index_space/element_bins.h"
#include "index_space/element_depth.h"
#include "index_space/node_frame.h"
#include "resample/statistic_names.h"
#include "software/software_resampler.h"
#include "tessera/error.h"
#include "tessera/lattice.h"
#include "tessera/registry.h"

namespace tessera {
namespace {

double exactError(const NodeFrame& frame, const TetMesh& mesh, std::size_t node, std::size_t axis) {
    const auto exact = exactIndexFromWorld(frame.lattice, mesh.points[node]);
    const mpq_class difference =
        exact[axis] - mpq_class(frame.nodes[node].whole[axis]) - mpq_class(frame.nodes[node].part[axis]);
    return std::fabs(difference.get_d());
}

TEST(NodeFrame, KeepsPlacesToAFewBitsOfOneVoxelHoweverFarFromTheOrigin) {
    std::mt19937_64 random(7);
    for (const double offset : {0.0, 1.0, 1e6, -1e9}) {
        TetMesh mesh;
        std::uniform_real_distribution<double> uniform(-1, 1);
        for (int i = 0; i < 200; ++i)
            mesh.points.push_back(
                {offset + uniform(random), offset + 1e-3 * uniform(random), 1e5 * uniform(random)});
        for (const double spacing : {1.0, 0.1, 1.0 / 3, 1e-3, 12345.678}) {
            const Lattice lattice = Lattice::axisParallel({offset + 0.1, offset - 0.7, 0.3}, spacing);
            const NodeFrame frame = frameNodes(mesh, lattice, {});
            for (std::size_t n = 0; n < mesh.points.size(); ++n)
                for (std::size_t a = 0; a < 3; ++a) EXPECT_LE(exactError(frame, mesh, n, a), 4 * 0x1p-53);
            onEveryTarget([&] {
                const NodeFrame same = frameNodes(mesh, lattice, {});
                for (std::size_t n = 0; n < mesh.points.size(); ++n)
                    EXPECT_EQ(std::memcmp(&same.nodes[n], &frame.nodes[n], 6 * sizeof(double)), 0);
            });
        }
    }
}

TEST(NodeFrame, TurnedLatticesAreAsAccurate) {
    TetMesh mesh;
    std::mt19937_64 random(8);
    std::uniform_real_distribution<double> uniform(-10, 10);
    for (int i = 0; i < 200; ++i) mesh.points.push_back({uniform(random), uniform(random), uniform(random)});
    const Lattice lattice{{0.1, 0.2, 0.3}, {0.02, 0.01, 0}, {-0.01, 0.02, 0.003}, {0.001, -0.002, 0.05}};
    const NodeFrame frame = frameNodes(mesh, lattice, {});
    for (std::size_t n = 0; n < mesh.points.size(); ++n)
        for (std::size_t a = 0; a < 3; ++a) EXPECT_LE(exactError(frame, mesh, n, a), 4 * 0x1p-53);
}

TEST(ElementDepth, IsTheDistanceToTheNearestFacePlane) {
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {8, 0, 0}, {0, 8, 0}, {0, 0, 8}};
    mesh.tets = {{0, 1, 2, 3}, {1, 0, 2, 3}};  // both orientations
    const NodeFrame frame = frameNodes(mesh, Lattice::axisParallel({0, 0, 0}, 1), {});
    for (const std::int32_t element : {0, 1}) {
        const ElementDepth depth(mesh, frame, element);
        EXPECT_DOUBLE_EQ(depth.at({1, 2, 1}), 1.0);
        EXPECT_DOUBLE_EQ(depth.at({2, 2, 2}), 2 / std::sqrt(3.0));
        EXPECT_DOUBLE_EQ(depth.at({0, 2, 1}), 0.0);
        EXPECT_DOUBLE_EQ(depth.at({-1, 2, 1}), -1.0);
    }
}

TEST(ElementDepth, SurvivesNeedlesThatDoubleCannotResolve) {
    TetMesh mesh;
    const double w = 1e-9;
    mesh.points = {{0, 0, 0}, {100.1, 70.3, 33.7}, {100.1 + w, 70.3, 33.7}, {100.1, 70.3 + w, 33.7 + w}};
    mesh.tets = {{0, 1, 2, 3}};
    const NodeFrame frame = frameNodes(mesh, Lattice::axisParallel({0, 0, 0}, 1), {});
    const double deep = ElementDepth(mesh, frame, 0).at({0, 0, 0});
    EXPECT_NEAR(deep, 0.0, 1e-4);
}

TEST(ElementBins, HoldEveryElementWhoseBoxHasAPointOfTheRegion) {
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> place(-5, 70), extent(-3, 3);
    TetMesh mesh;
    for (int e = 0; e < 3000; ++e) {
        const Vec3d corner{place(random), place(random), place(random)};
        std::array<std::int32_t, 4> tet;
        for (std::size_t k = 0; k < 4; ++k) {
            tet[k] = std::int32_t(mesh.points.size());
            mesh.points.push_back(corner + Vec3d{extent(random), extent(random), extent(random)});
        }
        mesh.tets.push_back(tet);
    }
    const std::vector<IndexBox> regions{{{0, 0, 0}, {16, 16, 16}},
                                        {{16, 0, 0}, {48, 32, 32}},
                                        {{8, 8, 8}, {24, 24, 9}},
                                        {{60, 60, 60}, {61, 61, 61}},
                                        {{-4, 30, 0}, {13, 47, 64}}};
    const NodeFrame frame = frameNodes(mesh, Lattice::axisParallel({0, 0, 0}, 1), {});
    const ElementBins bins = binElements(mesh, frame, regions, {});
    for (std::size_t r = 0; r < regions.size(); ++r) {
        const auto listed = bins.of(r);
        EXPECT_TRUE(std::is_sorted(listed.begin(), listed.end()));
        EXPECT_EQ(std::adjacent_find(listed.begin(), listed.end()), listed.end())
            << "an element stands twice";
        for (std::int32_t e = 0; e < mesh.elementCount(); ++e) {
            Box3d box;
            for (const std::int32_t node : mesh.tets[std::size_t(e)])
                box.include(mesh.points[std::size_t(node)]);
            bool holds = true;
            for (int a = 0; a < 3; ++a)
                holds = holds && std::max(std::ceil(box.min[a]), double(regions[r].min[a])) <=
                                     std::min(std::floor(box.max[a]), double(regions[r].max[a] - 1));
            if (holds) {
                EXPECT_TRUE(std::binary_search(listed.begin(), listed.end(), e))
                    << "element " << e << " region " << r;
            }
        }
    }
}

using NodePlaces = std::array<glm::i64vec3, 4>;

// Sixfold volume; exact for nodes in 1024ths of a voxel, relative to a lattice point nearby.
std::int64_t sixfold1024(const NodePlaces& p) {
    const glm::i64vec3 a = p[1] - p[0], b = p[2] - p[0], c = p[3] - p[0];
    return a.x * (b.y * c.z - b.z * c.y) + a.y * (b.z * c.x - b.x * c.z) + a.z * (b.x * c.y - b.y * c.x);
}

bool holdsPoint(const NodePlaces& nodes1024, const glm::i64vec3& point1024) {
    const std::int64_t volume = sixfold1024(nodes1024);
    for (std::size_t k = 0; k < 4; ++k) {
        auto withPoint = nodes1024;
        withPoint[k] = point1024;
        if (sixfold1024(withPoint) * (volume < 0 ? -1 : 1) < 0) return false;
    }
    return true;
}

TEST(ElementBins, DropsMostElementsBetweenPointsAndNoneThatHoldsOne) {
    std::mt19937 random(7);
    // Near the origin, and where simple precision is a 4096th of a voxel.
    for (const std::int64_t away : {0, 3000}) {
        TetMesh mesh;
        std::vector<NodePlaces> nodes1024;
        for (int e = 0; e < 20000; ++e) {
            const std::int64_t step =
                std::array<std::int64_t, 4>{1, 16, 256, 512}[std::size_t(e % 4)];  // the coarse ones touch
            std::uniform_int_distribution<std::int64_t> place(0, 2048 / step);
            NodePlaces nodes;
            std::array<std::int32_t, 4> tet;
            for (std::size_t k = 0; k < 4; ++k) {
                for (int a = 0; a < 3; ++a) nodes[k][a] = place(random) * step + (e % 3 == 0 ? 0 : 300);
                tet[k] = std::int32_t(mesh.points.size());
                mesh.points.push_back(Vec3d(nodes[k]) / 1024.0 + double(away));
            }
            if (sixfold1024(nodes) == 0) continue;
            mesh.tets.push_back(tet);
            nodes1024.push_back(nodes);
        }
        const int first = int(away);
        const std::vector<IndexBox> regions{{Vec3i(first), Vec3i(first + 4)}};
        const NodeFrame frame = frameNodes(mesh, Lattice::axisParallel({0, 0, 0}, 1), {});
        const ElementBins bins = binElements(mesh, frame, regions, {}, {.dropsBetween = true});
        const ElementBins boxes = binElements(mesh, frame, regions, {});
        std::int64_t between = 0;
        for (std::int32_t e = 0; e < mesh.elementCount(); ++e) {
            bool holds = false;
            for (int p = 0; p < 27; ++p)
                holds = holds || holdsPoint(nodes1024[std::size_t(e)],
                                            glm::i64vec3(p % 3, p / 3 % 3, p / 9) * std::int64_t(1024));
            const auto listed = bins.of(0);
            EXPECT_TRUE(!holds || std::binary_search(listed.begin(), listed.end(), e)) << "element " << e;
            between += holds ? 0 : 1;
        }
        const std::int64_t dropped = std::int64_t(boxes.elements.size() - bins.elements.size());
        EXPECT_GT(dropped, away == 0 ? between * 2 / 3 : between / 4);
        onEveryTarget([&] {
            const ElementBins same = binElements(mesh, frame, regions, {}, {.dropsBetween = true});
            EXPECT_TRUE(std::ranges::equal(same.of(0), bins.of(0)));
        });
    }
}

TEST(SoftwareResampler, DeliversEveryBoxOnceEvenEmptyOnes) {
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {8, 0, 0}, {0, 8, 0}, {0, 0, 8}};
    mesh.tets = {{0, 1, 2, 3}};
    const SoftwareResampler software;
    const auto bound = software.bind(mesh, {}, {});
    const std::vector<IndexBox> boxes{
        {{0, 0, 0}, {9, 9, 9}}, {{3, 3, 3}, {3, 9, 9}}, {{100, 100, 100}, {108, 108, 108}}};
    std::vector<int> calls(boxes.size(), 0);
    Execution execution;
    execution.threads = 1;
    const auto statistics = bound->resample(
        Lattice::axisParallel({0, 0, 0}, 1), boxes,
        [&](std::size_t box, const Block& block) {
            ++calls[box];
            EXPECT_EQ(block.box, boxes[box]);
            EXPECT_EQ(block.coverage.size(), block.count());
        },
        execution);
    EXPECT_EQ(calls, (std::vector<int>{1, 1, 1}));
    EXPECT_EQ(statistics.count(counted::coveredPoints), 165);  // points with i + j + k <= 8: 11 choose 3
}

TEST(SoftwareResampler, RefusesLatticesThatCannotBe) {
    TetMesh mesh;
    const SoftwareResampler software;
    const auto bound = software.bind(mesh, {}, {});
    const IndexBox box{{0, 0, 0}, {1, 1, 1}};
    const auto ignore = [](std::size_t, const Block&) {};
    for (const double spacing : {0.0, double(NAN), double(INFINITY)})
        EXPECT_THROW(bound->resample(Lattice::axisParallel({0, 0, 0}, spacing), {&box, 1}, ignore, {}),
                     InputError);
    const IndexBox far{{0, 0, 0}, {(1 << 30) + 1, 1, 1}};
    EXPECT_THROW(bound->resample(Lattice::axisParallel({0, 0, 0}, 1), {&far, 1}, ignore, {}), InputError);
}

TEST(SoftwareResampler, ATargetThatIsAskedForRuns) {
    TetMesh mesh;
    const SoftwareResampler software;
    ASSERT_FALSE(software.targets().empty());
    for (const std::string& target : software.targets())
        EXPECT_EQ(software.bind(mesh, {}, {.target = target})->target(), target);
    EXPECT_EQ(software.bind(mesh, {}, {})->target(), software.targets().front());
    EXPECT_THROW(software.bind(mesh, {}, {.target = "no such"}), InputError);
}

// Elements of one to twenty voxels in all directions, overlapping: runs of all lengths, contested points, all
// scan axes.
TetMesh manyElements(int count) {
    std::mt19937_64 random(11);
    std::uniform_real_distribution<double> place(-4, 36), size(-10, 10), value(-1, 1);
    std::uniform_int_distribution<int> thin(0, 5);
    TetMesh mesh;
    for (const char* name : {"f", "g"}) mesh.fields.push_back({name, FieldLocation::point, 1, {}});
    for (int e = 0; e < count; ++e) {
        const Vec3d middle(place(random), place(random), place(random));
        Vec3d reach(1);
        const int axis = thin(random);
        if (axis < 3) reach = Vec3d(0.15), reach[axis] = 1;
        for (int k = 0; k < 4; ++k) {
            mesh.points.push_back(middle + reach * Vec3d(size(random), size(random), size(random)));
            for (Field& field : mesh.fields) field.values.push_back(value(random));
        }
        mesh.tets.push_back({4 * e, 4 * e + 1, 4 * e + 2, 4 * e + 3});
    }
    return mesh;
}

struct Sampled {
    std::vector<float> values;
    std::vector<std::uint8_t> coverage;
    bool operator==(const Sampled&) const = default;
};

Sampled sampled(const TetMesh& mesh, std::span<const int> fields, const BindOptions& options,
                const IndexBox& box, int threads) {
    Execution execution;
    execution.threads = threads;
    Sampled result;
    SoftwareResampler()
        .bind(mesh, fields, options)
        ->resample(
            Lattice::axisParallel({0, 0, 0}, 1), {&box, 1},
            [&](std::size_t, const Block& block) {
                result.values.assign(block.values.begin(), block.values.end());
                result.coverage.assign(block.coverage.begin(), block.coverage.end());
            },
            execution);
    return result;
}

TEST(SoftwareResampler, EveryTargetAndCutIntoRegionsGivesTheSameBits) {
    const TetMesh mesh = manyElements(1200);
    const IndexBox box{{0, 0, 0}, {70, 33, 20}};
    for (const std::vector<int>& fields : {std::vector<int>{}, std::vector<int>{1}, std::vector<int>{0, 1}}) {
        const Sampled first = sampled(mesh, fields, {}, box, 1);
        ASSERT_GT(std::count(first.coverage.begin(), first.coverage.end(), 1), 10000);
        for (const std::string& target : SoftwareResampler().targets())
            for (const Route route : {Route::pass, Route::index})
                for (const int threads : {1, 4})
                    EXPECT_EQ(sampled(mesh, fields, {.target = target, .route = route}, box, threads), first)
                        << target << ", " << fields.size() << " fields, " << threads << " threads";
    }
}

// The deepest element owns a point that several cover, whichever came first.
TEST(SoftwareResampler, TheOrderOfElementsDecidesNothing) {
    TetMesh mesh = manyElements(600);
    const IndexBox box{{0, 0, 0}, {70, 33, 20}};
    for (const std::string& target : SoftwareResampler().targets()) {
        const Sampled ascending = sampled(mesh, std::vector<int>{0}, {.target = target}, box, 1);
        std::shuffle(mesh.tets.begin(), mesh.tets.end(), std::mt19937_64(5));
        EXPECT_EQ(sampled(mesh, std::vector<int>{0}, {.target = target}, box, 1), ascending) << target;
    }
}

TEST(SoftwareResampler, ElementsThatReachFarBeyondTheLatticeCoverAllOfIt) {
    for (const double reach : {1e10, 1e17, 1e30, 1e100}) {
        TetMesh mesh;
        mesh.points = {{-reach, -reach, -reach},
                       {4 * reach, -reach, -reach},
                       {-reach, 4 * reach, -reach},
                       {-reach, -reach, 4 * reach}};
        mesh.tets = {{0, 1, 2, 3}};
        const Sampled result = sampled(mesh, {}, {}, {{-3, 1, 3}, {18, 9, 9}}, 1);
        EXPECT_EQ(std::count(result.coverage.begin(), result.coverage.end(), 1), 21 * 8 * 6) << reach;
    }
}

TEST(SoftwareResampler, ElementsWithoutAPlaceCoverNothing) {
    for (const double nowhere : {double(NAN), double(INFINITY)}) {
        TetMesh mesh;
        mesh.points = {{4, 4, 4.2}, {6, 4, 4.4}, {4, 6, 4.6}, {5, nowhere, 4.8}, {nowhere, 5, 5}};
        mesh.tets = {{0, 1, 2, 3}, {0, 1, 2, 4}, {4, 2, 1, 3}};
        for (const Route route : {Route::pass, Route::index}) {
            const Sampled result =
                sampled(mesh, {}, {.target = {}, .route = route}, {{3, 3, 3}, {8, 8, 8}}, 1);
            EXPECT_EQ(std::count(result.coverage.begin(), result.coverage.end(), 1), 0);
        }
    }
}

TEST(Registry, FindsByNameAndListsTheNamesOtherwise) {
    EXPECT_EQ(findResampler("software").name(), "software");
    try {
        findResampler("hardware");
        FAIL();
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("software"), std::string::npos);
    }
}

}  // namespace
}  // namespace tessera
