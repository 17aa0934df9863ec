#include "resample/stoppable_sampling.h"
#include "mesh/element_index.h"
#include "resample/statistic_names.h"
#include "tessera/lattice.h"

#include <gtest/gtest.h>

#include <cstring>
#include <numeric>

#include "reference/fields.h"
#include "reference/generators.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;

constexpr Clock::time_point kAtOnce = Clock::time_point::min();
constexpr Clock::time_point kNever = Clock::time_point::max();

/// 48,000 elements, a field of points and one of cells.
TetMesh makeMesh() {
    TetMesh mesh = boxMesh({.cells = {20, 20, 20}, .jitter = 0.2});
    addPointField(mesh, "f", {[](const Vec3d& p) { return p.x * p.y - p.z; }});
    mesh.fields.push_back({"id", FieldLocation::cell, 1, {}});
    mesh.fields.back().values.resize(mesh.tets.size());
    std::iota(mesh.fields.back().values.begin(), mesh.fields.back().values.end(), 0.0);
    return mesh;
}

struct Case {
    TetMesh mesh = makeMesh();
    std::vector<int> fields{0, 1};
    /// The whole mesh in one small box, a fine box, an empty one and one beside the mesh.
    Lattice coarse = Lattice::axisParallel(Vec3d(0.01), 0.11);
    std::vector<IndexBox> boxes{
        {Vec3i(0), Vec3i(9)}, {{2, 2, 2}, {5, 4, 3}}, {Vec3i(3), Vec3i(3)}, {Vec3i(50), Vec3i(52)}};
    std::shared_ptr<const SharedElementIndex> index = std::make_shared<const SharedElementIndex>(mesh);

    std::unique_ptr<BoundResampler> bind(const Resampler& resampler, Route route) const {
        BindOptions options;
        options.route = route;
        options.index = index;
        return resampler.bind(mesh, fields, options);
    }
    std::vector<Block> atOnce(const Resampler& resampler) const {
        std::vector<Block> blocks(boxes.size());
        bind(resampler, Route::pass)
            ->resample(coarse, boxes, [&](std::size_t b, const Block& block) { blocks[b] = block; },
                       {.threads = 1});
        return blocks;
    }
};

void expectSame(const Block& a, const Block& b) {
    EXPECT_EQ(a.box, b.box);
    EXPECT_EQ(a.channels, b.channels);
    EXPECT_EQ(a.coverage, b.coverage);
    ASSERT_EQ(a.values.size(), b.values.size());
    const bool isSame =
        a.values.empty() || std::memcmp(a.values.data(), b.values.data(), 4 * a.values.size()) == 0;
    EXPECT_TRUE(isSame);
}

TEST(StoppableSampling, GivesTheSamplesOfOneCallInManySteps) {
    const Case at;
    const Resampler& software = findResampler("software");
    const std::vector<Block> expected = at.atOnce(software);
    const auto bound = at.bind(software, Route::index);
    std::vector<Block> blocks(at.boxes.size());
    std::vector<int> calls(at.boxes.size(), 0);
    StoppableSampling sampling(*bound, at.index, at.coarse, at.boxes, [&](std::size_t b, const Block& block) {
        blocks[b] = block;
        ++calls[b];
    });
    int steps = 0;
    std::int64_t nearBefore = 0;
    while (!sampling.isDone()) {
        sampling.advance(kAtOnce, {.threads = 1});
        ++steps;
        const std::int64_t near = sampling.statistics().count(counted::elementsNear);
        EXPECT_LT(near - nearBefore, at.mesh.elementCount() / 8) << "a step is a small part of the work";
        nearBefore = near;
    }
    EXPECT_GT(steps, 10);
    EXPECT_EQ(calls, (std::vector<int>{1, 1, 1, 1}));
    for (std::size_t b = 0; b < blocks.size(); ++b) expectSame(blocks[b], expected[b]);
    EXPECT_TRUE(sampling.advance(kAtOnce)) << "nothing is left";
}

TEST(StoppableSampling, GoesOnToTheEndWithoutADeadline) {
    const Case at;
    for (const Resampler* resampler : resamplers()) {
        if (!resampler->unavailableReason().empty() || !resampler->info().meetsContract) continue;
        const std::vector<Block> expected = at.atOnce(*resampler);
        const auto bound = at.bind(*resampler, Route::index);
        std::vector<Block> blocks(at.boxes.size());
        StoppableSampling sampling(*bound, at.index, at.coarse, std::span(at.boxes).first(2),
                                   [&](std::size_t b, const Block& block) { blocks[b] = block; });
        EXPECT_TRUE(sampling.advance(kNever));
        for (std::size_t b = 0; b < 2; ++b) expectSame(blocks[b], expected[b]);
    }
}

TEST(StoppableSampling, GoesOnAfterItWasCancelled) {
    const Case at;
    const Resampler& software = findResampler("software");
    const std::vector<Block> expected = at.atOnce(software);
    const auto bound = at.bind(software, Route::index);
    std::vector<Block> blocks(at.boxes.size());
    StoppableSampling sampling(*bound, at.index, at.coarse, at.boxes,
                               [&](std::size_t b, const Block& block) { blocks[b] = block; });
    sampling.advance(kAtOnce);
    std::atomic<bool> cancel{true};
    EXPECT_THROW(sampling.advance(kNever, {.threads = 1, .cancel = &cancel}), Cancelled);
    EXPECT_TRUE(sampling.advance(kNever));
    for (std::size_t b = 0; b < blocks.size(); ++b) expectSame(blocks[b], expected[b]);
}

TEST(StoppableSampling, RefusesWhatOneCallRefuses) {
    const Case at;
    const auto bound = at.bind(findResampler("software"), Route::index);
    const IndexBox far{{0, 0, 0}, {(1 << 30) + 1, 1, 1}};
    EXPECT_THROW(StoppableSampling(*bound, at.index, at.coarse, std::span(&far, 1), {}), InputError);
}

}  // namespace
}  // namespace tessera
