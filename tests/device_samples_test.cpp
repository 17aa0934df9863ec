#include "slab/device_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "gl/gl_platform.h"
#include "gl_test_tools.h"
#include "hybrid/hybrid_resampler.h"
#include "reference/fields.h"
#include "reference/generators.h"
#include "slab/slab_device.h"
#include "slicing/slicing_resampler.h"

namespace tessera {
namespace {

TetMesh meshWithFields() {
    TetMesh mesh = boxMesh({.cells = {4, 4, 4}, .sizeWorld = {280, 12, 11}, .jitter = 0.2});
    addPointField(mesh, "linear",
                  {[](const Vec3d& p) { return p.x - 2 * p.y; }, [](const Vec3d& p) { return p.z; }});
    addRandomField(mesh, "pressure", FieldLocation::point, 1, 101325, 1, 3);
    addRandomField(mesh, "cells", FieldLocation::cell, 2, 0, 1, 4);
    return mesh;
}

class SamplesOnDevice : public testing::TestWithParam<SampleFormat> {};

TEST_P(SamplesOnDevice, AreThoseThatAreReadBack) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    const TetMesh mesh = meshWithFields();
    std::vector<int> fields(mesh.fields.size());
    std::iota(fields.begin(), fields.end(), 0);
    const Lattice lattice = Lattice::axisParallel({0.3, 0.2, 0.1}, 1);
    const IndexBox box{{-2, -1, -2}, {290, 14, 13}};
    const BindOptions options{"egl-surfaceless", GetParam()};
    const SlicingResampler slicing;
    Block block;
    slicing.bind(mesh, fields, options)
        ->resample(lattice, std::span(&box, 1), [&](std::size_t, const Block& b) { block = b; }, {});
    const auto bound = slicing.bindToDevice(mesh, fields, options);
    const std::shared_ptr<const DeviceSamples> samples = bound->resampleOnDevice(lattice, box, {});
    ASSERT_EQ(samples->groups.size(), 2u);
    ASSERT_EQ(samples->decodings.size(), 5u);
    std::int64_t covered = 0, wrong = 0;
    std::size_t channel = 0;
    for (const DeviceSamples::Group& group : samples->groups) {
        const int components = group.channels == 1 ? 1 : 4;
        std::vector<float> codes(block.count() * std::size_t(components));
        std::vector<std::uint8_t> coverage(block.count());
        sharedSlabDevice(GlPlatform::eglSurfaceless).thread().run([&](GlContext& context) {
            const GlFunctions& gl = context.functions();
            gl.GetTextureImage(group.codes.id(), 0, components == 1 ? GL_RED : GL_RGBA, GL_FLOAT,
                               GLsizei(codes.size() * 4), codes.data());
            if (group.coverage)
                gl.GetTextureImage(group.coverage.id(), 0, GL_RED, GL_UNSIGNED_BYTE, GLsizei(coverage.size()),
                                   coverage.data());
        });
        for (int c = 0; c < group.channels; ++c, ++channel) {
            const DeviceSamples::Decoding& decoding = samples->decodings[channel];
            for (std::size_t i = 0; i < block.count(); ++i) {
                const float code = codes[i * std::size_t(components) + std::size_t(c)];
                const bool isCovered = group.coverage ? coverage[i] != 0 : code != samples->marks.uncovered;
                wrong += isCovered != (block.coverage[i] != 0);
                if (!isCovered) continue;
                ++covered;
                const double value = decoding.scale * double(code) + decoding.offset;
                const double expected = double(block.channel(int(channel))[i]);
                wrong += !(std::abs(value - expected) <= 1e-6 * std::abs(expected) + 1e-12);
            }
        }
    }
    EXPECT_GT(covered, 100000);
    EXPECT_EQ(wrong, 0);
}

INSTANTIATE_TEST_SUITE_P(All, SamplesOnDevice,
                         testing::Values(SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16,
                                         SampleFormat::r8),
                         [](const testing::TestParamInfo<SampleFormat>& param) {
                             return std::string(nameOf(param.param));
                         });

TEST(PublishedClassification, CoversTheInsideOfAConformingMeshAndGivesNearlyTheSameValues) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    TetMesh mesh = boxMesh({.cells = {5, 5, 5}, .sizeWorld = {30, 30, 30}, .jitter = 0.2});
    addPointField(mesh, "linear", {[](const Vec3d& p) { return p.x + 2 * p.y - p.z; }});
    const Lattice lattice = Lattice::axisParallel(Vec3d(0.37), 1);
    // Away from the boundary, where the fill rule may drop points.
    const IndexBox box{Vec3i(1), Vec3i(28)};
    const HybridResampler hybrid;
    const SlicingResampler slicing;
    for (const Resampler* resampler :
         {static_cast<const Resampler*>(&hybrid), static_cast<const Resampler*>(&slicing)}) {
        Block block;
        resampler
            ->bind(mesh, std::vector{0}, {"egl-surfaceless", SampleFormat::r32f, Classification::published})
            ->resample(lattice, std::span(&box, 1), [&](std::size_t, const Block& b) { block = b; }, {});
        std::int64_t holes = 0;
        double worst = 0;
        Vec3i p;
        for (p.z = 1; p.z < 28; ++p.z)
            for (p.y = 1; p.y < 28; ++p.y)
                for (p.x = 1; p.x < 28; ++p.x) {
                    if (!block.covered(p)) {
                        ++holes;
                        continue;
                    }
                    const Vec3d at = Vec3d(p) + 0.37;
                    worst = std::max(worst, std::abs(double(block.value(0, p)) - (at.x + 2 * at.y - at.z)));
                }
        // The hybrid's polygons fit; slicing's alpha test may lose points on shared faces.
        if (resampler == &hybrid)
            EXPECT_EQ(holes, 0);
        else
            EXPECT_LT(holes, 20);
        EXPECT_LT(worst, 0.05) << resampler->name();
    }
}

}  // namespace
}  // namespace tessera
