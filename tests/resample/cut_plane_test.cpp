#include "resample/cut_plane.h"
#include "resample/statistic_names.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>

#include "reference/generators.h"
#include "reference/random.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {
namespace {

/// f = a linear function, in double exactly what the tests expect.
double linear(const Vec3d& p) {
    return 3 + 2 * p.x - p.y + 0.5 * p.z;
}

void addFields(TetMesh& mesh) {
    Field scalar{"f", FieldLocation::point, 1, {}}, vector{"v", FieldLocation::point, 3, {}},
        cell{"c", FieldLocation::cell, 1, {}};
    for (const Vec3d& p : mesh.points) {
        scalar.values.push_back(linear(p));
        for (int k = 0; k < 3; ++k) vector.values.push_back(std::sin(7 * p[k]));
    }
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) cell.values.push_back(double(e));
    mesh.fields = {scalar, vector, cell};
}

Cut planned(const TetMesh& mesh, const CutOptions& options) {
    return planCut(mesh, PlaneQuery(mesh), options);
}

CutOptions towards(const Vec3d& normal, int resolution = 64) {
    CutOptions options;
    options.normal = normal;
    options.resolution = resolution;
    return options;
}

/// Runs on every registered resampler.
class EveryResampler : public testing::TestWithParam<const Resampler*> {
  protected:
    void SetUp() override {
        const std::string reason = GetParam()->unavailableReason();
        if (reason.empty()) return;
        ASSERT_EQ(std::getenv("TESSERA_REQUIRE_GL"), nullptr) << reason;
        GTEST_SKIP() << reason;
    }
};

std::vector<const Resampler*> thoseOfTheContract() {
    std::vector<const Resampler*> all(resamplers().begin(), resamplers().end());
    std::erase_if(all, [](const Resampler* resampler) { return !resampler->info().meetsContract; });
    return all;
}

INSTANTIATE_TEST_SUITE_P(CutPlane, EveryResampler, testing::ValuesIn(thoseOfTheContract()),
                         [](const auto& test) { return test.param->name(); });

/// The cut's pixels from the whole mesh.
Block wholeMeshBlock(const TetMesh& mesh, const CutFrame& frame, const std::vector<int>& fields,
                     const Resampler& resampler) {
    return resampleBlock(resampler, mesh, fields, frame.lattice, {{0, 0, 0}, {frame.width, frame.height, 1}});
}

void expectSameBits(const TetMesh& mesh, const Cut& cut, const Resampler& resampler,
                    const std::string& what) {
    const std::vector<int> fields{0, 1, 2};
    const CutSamples samples = sampleCut(mesh, cut, fields, resampler, {}, {});
    const Block block = wholeMeshBlock(mesh, cut.frame, fields, resampler);
    ASSERT_EQ(samples.channels.size(), 5u);
    std::int64_t different = 0, covered = 0;
    for (int y = 0; y < samples.height; ++y)
        for (int x = 0; x < samples.width; ++x) {
            const std::size_t i = std::size_t(y) * std::size_t(samples.width) + std::size_t(x);
            const Vec3i p{x, samples.height - 1 - y, 0};
            covered += samples.coverage[i];
            different += samples.coverage[i] != int(block.covered(p));
            for (std::size_t c = 0; c < 5 && block.covered(p); ++c) {
                const float a = samples.channels[c][i], b = block.value(int(c), p);
                different += std::memcmp(&a, &b, sizeof a) != 0;
            }
        }
    EXPECT_EQ(different, 0) << what;
    EXPECT_EQ(samples.statistics.count(counted::coveredPoints), covered) << what;
}

TEST_P(EveryResampler, GivesACutTheSameBitsAsTheWholeMeshDoes) {
    Random random(5);
    std::vector<std::pair<std::string, TetMesh>> all;
    all.emplace_back("box", boxMesh({.cells = Vec3i(6), .jitter = 0.25}));
    all.emplace_back("aligned", boxMesh({.cells = Vec3i(4), .isFiveSplit = true}));
    all.emplace_back("graded", gradedDelaunayMesh(400, 3, 2));
    all.emplace_back("layers", boundaryLayerMesh(5, 1e-6));
    all.emplace_back("thin", thinClusterMesh(1e-4, 1, 200, 9));
    all.emplace_back("overlapping", overlappingMesh(200, 6));
    for (auto& [name, mesh] : all) {
        addFields(mesh);
        const PlaneQuery query(mesh);
        for (int trial = 0; trial < 12; ++trial) {
            CutOptions options = towards(
                trial < 3 ? Vec3d(trial == 0, trial == 1, trial == 2) : glm::normalize(random.offset()), 100);
            if (trial % 2)
                options.originWorld = mesh.points[std::size_t(random.below(int(mesh.nodeCount())))];
            if (trial % 4 == 3) options.sizeWorld = std::array{0.3, 0.2};
            const Cut cut = planCut(mesh, query, options);
            expectSameBits(mesh, cut, *GetParam(), name + " " + std::to_string(trial));
        }
    }
}

TEST(CutPlane, KeepsElementsBesideThePlaneThatMayOwnItsPoints) {
    // The plane lies half a spill bound above the mesh: whether its points are covered is for the resampler
    // to say, and so the elements must be among those it is given.
    TetMesh mesh = boxMesh({.cells = Vec3i(2)});
    addFields(mesh);
    CutOptions options = towards({0, 0, 1}, 64);
    options.sizeWorld = std::array{1.0, 1.0};
    options.spillVoxels = 0x1p-8;
    options.originWorld = Vec3d(0.5, 0.5, 0.5 + 0x1p-9 / 64);
    // Both layers of cells, though the plane cuts the upper one only.
    EXPECT_EQ(planned(mesh, options).hits.elements.size(), mesh.tets.size());
}

TEST(CutPlane, AxesAreThoseOfPicture) {
    const TetMesh mesh = boxMesh({.cells = Vec3i(2)});
    for (const double sign : {1.0, -1.0, 5.0}) {
        const Lattice z = planned(mesh, towards({0, 0, sign})).frame.lattice;
        const Lattice y = planned(mesh, towards({0, sign, 0})).frame.lattice;
        const Lattice x = planned(mesh, towards({sign, 0, 0})).frame.lattice;
        const double h = 1.0 / 64, w = sign < 0 ? -h : h;
        EXPECT_EQ(z, (Lattice{{h / 2, h / 2, 0.5}, {h, 0, 0}, {0, h, 0}, {0, 0, w}}));
        EXPECT_EQ(y, (Lattice{{h / 2, 0.5, h / 2}, {h, 0, 0}, {0, 0, h}, {0, w, 0}}));
        EXPECT_EQ(x, (Lattice{{0.5, h / 2, h / 2}, {0, h, 0}, {0, 0, h}, {w, 0, 0}}));
    }
}

TEST(CutPlane, AxesOfAnyPlaneArePerpendicularAndUpPointsUp) {
    const TetMesh mesh = boxMesh({.cells = Vec3i(2)});
    Random random(8);
    for (int trial = 0; trial < 200; ++trial) {
        CutOptions options = towards(random.offset() * std::ldexp(1.0, trial - 100));
        if (trial % 2) options.up = random.offset();
        const Cut cut = planned(mesh, options);
        const Lattice& l = cut.frame.lattice;
        const double h = cut.frame.spacingWorld();
        EXPECT_NEAR(glm::length(l.vWorld), h, 1e-15);
        EXPECT_NEAR(glm::length(l.wWorld), h, 1e-15);
        for (const double product :
             {glm::dot(l.uWorld, l.vWorld), glm::dot(l.vWorld, l.wWorld), glm::dot(l.wWorld, l.uWorld)})
            EXPECT_NEAR(product, 0, 1e-14 * h * h);
        EXPECT_NEAR(glm::dot(cut.normal, options.normal), glm::length(options.normal),
                    1e-12 * glm::length(options.normal));
        if (options.up) {
            EXPECT_GT(glm::dot(l.vWorld, *options.up), 0);
        }
    }
}

TEST(CutPlane, UpTurnsThePictureAndNeverMirrorsIt) {
    const TetMesh mesh = boxMesh({.cells = Vec3i(2)});
    for (const Vec3d& normal :
         {Vec3d(0, 0, 1), Vec3d(0, 1, 0), Vec3d(1, 0, 0), Vec3d(0, -1, 0), Vec3d(1, 2, 3)}) {
        CutOptions options = towards(normal);
        const Lattice usual = planned(mesh, options).frame.lattice;
        const auto side = [](const Lattice& l) {
            return glm::dot(glm::cross(l.uWorld, l.vWorld), l.wWorld) > 0;
        };
        options.up = usual.vWorld;
        const Lattice same = planned(mesh, options).frame.lattice;
        EXPECT_LT(glm::length(same.uWorld - usual.uWorld), 1e-15);
        options.up = usual.uWorld - 0.3 * usual.vWorld;
        EXPECT_EQ(side(planned(mesh, options).frame.lattice), side(usual));
    }
}

TEST(CutPlane, PictureIsTightAroundTheCutAndPixelsAreSquare) {
    const TetMesh mesh = boxMesh({.cells = Vec3i(3), .originWorld = {1, 2, 3}, .sizeWorld = {4, 1, 2}});
    const Cut z = planned(mesh, towards({0, 0, 1}, 100));
    EXPECT_EQ(z.frame.width, 100);
    EXPECT_EQ(z.frame.height, 25);
    EXPECT_NEAR(z.frame.spacingWorld(), 0.04, 1e-15);
    EXPECT_NEAR(glm::length(z.frame.lattice.originWorld - Vec3d(1.02, 2.02, 4)), 0, 1e-14);
    // All of it is mesh.
    TetMesh sampled = mesh;
    addFields(sampled);
    const CutSamples samples = sampleCut(sampled, z, std::vector<int>{0}, findResampler("software"), {}, {});
    EXPECT_EQ(samples.statistics.count(counted::coveredPoints), 2500);
}

TEST_P(EveryResampler, GivesALinearFieldBackOnAnObliquePlane) {
    TetMesh mesh = boxMesh({.cells = Vec3i(7), .jitter = 0.25});
    addFields(mesh);
    CutOptions options = towards({1, 2, 3}, 200);
    options.originWorld = Vec3d(0.4, 0.5, 0.45);
    const Cut cut = planned(mesh, options);
    // The bounds of the contract: a point may be covered from so far outside, a value be that of a place so
    // near.
    const double beyond = 1e-12 + GetParam()->info().spillBoundVoxels * cut.frame.spacingWorld();
    const double offPlace = GetParam()->info().placeBoundVoxels * cut.frame.spacingWorld();
    const CutSamples samples = sampleCut(mesh, cut, std::vector<int>{0}, *GetParam(), {}, {});
    std::int64_t inside = 0;
    for (int y = 0; y < samples.height; ++y)
        for (int x = 0; x < samples.width; ++x) {
            const Vec3d p = cut.frame.lattice.worldFromIndex({x, samples.height - 1 - y, 0});
            EXPECT_NEAR(glm::dot(p - *options.originWorld, cut.normal), 0, 1e-14);
            const std::size_t i = std::size_t(y) * std::size_t(samples.width) + std::size_t(x);
            const double depth = std::min({p.x, p.y, p.z, 1 - p.x, 1 - p.y, 1 - p.z});
            if (std::abs(depth) > beyond) {
                EXPECT_EQ(samples.coverage[i] != 0, depth > 0) << x << ' ' << y;
            }
            if (!samples.coverage[i]) continue;
            ++inside;
            EXPECT_NEAR(samples.channels[0][i], linear(p), 4e-6 + 3 * offPlace);
        }
    EXPECT_GT(inside, 10000);
}

TEST(CutPlane, LargePicturesComeInTilesThatFitTogether) {
    TetMesh mesh = boxMesh({.cells = Vec3i(2), .sizeWorld = {1, 0.6, 1}});
    addFields(mesh);
    const Cut cut = planned(mesh, towards({0, 0, 1}, 5000));
    const CutSamples samples = sampleCut(mesh, cut, std::vector<int>{0}, findResampler("software"), {}, {});
    ASSERT_EQ(samples.width, 5000);
    ASSERT_EQ(samples.height, 3000);
    for (int y = 0; y < samples.height; y += 7)
        for (int x = 0; x < samples.width; x += 13) {
            const Vec3d p = cut.frame.lattice.worldFromIndex({x, samples.height - 1 - y, 0});
            const std::size_t i = std::size_t(y) * std::size_t(samples.width) + std::size_t(x);
            ASSERT_TRUE(samples.coverage[i]);
            ASSERT_NEAR(samples.channels[0][i], linear(p), 4e-6);
        }
}

TEST(CutPlane, BadOptionsAreRejectedWithTheirReason) {
    const TetMesh mesh = boxMesh({.cells = Vec3i(2)});
    const double nan = std::nan("");
    const auto rejects = [&](const CutOptions& options, const std::string& word) {
        try {
            planned(mesh, options);
            ADD_FAILURE() << "accepted, expected: " << word;
        } catch (const InputError& error) {
            EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << error.what();
        }
    };
    rejects(towards({0, 0, 0}), "zero");
    rejects(towards({0, nan, 0}), "finite");
    rejects(towards({0, 0, 1}, 0), "pixels");
    rejects(towards({0, 0, 1}, kLargestCutResolution + 1), "16384");
    CutOptions options = towards({0, 0, 1});
    options.up = Vec3d(0, 0, -2);
    rejects(options, "upward");
    options = towards({0, 0, 1});
    options.originWorld = Vec3d(0, 0, 1.5);
    rejects(options, "misses the mesh");
    options.originWorld = Vec3d(0, 0, nan);
    rejects(options, "finite");
    options.originWorld = Vec3d(9, 9, 0.5);
    options.sizeWorld = std::array{1.0, 1.0};
    rejects(options, "misses the mesh");
    options.sizeWorld = std::array{0.0, 1.0};
    rejects(options, "above 0");
    options = towards({1, 1, 1});
    options.originWorld = Vec3d(1, 1, 1);
    rejects(options, "point");
    EXPECT_THROW(planned(TetMesh{}, towards({0, 0, 1})), InputError);
}

}  // namespace
}  // namespace tessera
