#include "raster/device_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "gl/gl_platform.h"
#include "gl_test_tools.h"
#include "hybrid/hybrid_resampler.h"
#include "raster/raster_device.h"
#include "reference/fields.h"
#include "reference/generators.h"
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
        sharedRasterDevice(GlPlatform::eglSurfaceless).thread().run([&](GlContext& context) {
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

struct PublishedRun {
    std::int64_t covered = 0;
    double worst = 0;
};

/// Samples a jittered box of 30 voxels on a lattice of unit spacing; with the usual offset 27^3 points, 1 to
/// 27, lie well inside.
PublishedRun runPublished(const Resampler& resampler, const IndexBox& box, double offset = 0.37) {
    TetMesh mesh = boxMesh({.cells = {5, 5, 5}, .sizeWorld = {30, 30, 30}, .jitter = 0.2});
    addPointField(mesh, "linear", {[](const Vec3d& p) { return p.x + 2 * p.y - p.z; }});
    Block block;
    resampler.bind(mesh, std::vector{0}, {.target = "egl-surfaceless"})
        ->resample(Lattice::axisParallel(Vec3d(offset), 1), std::span(&box, 1),
                   [&](std::size_t, const Block& b) { block = b; }, {});
    PublishedRun run;
    Vec3i p;
    for (p.z = box.min.z; p.z < box.max.z; ++p.z)
        for (p.y = box.min.y; p.y < box.max.y; ++p.y)
            for (p.x = box.min.x; p.x < box.max.x; ++p.x) {
                if (!block.covered(p)) continue;
                ++run.covered;
                const Vec3d at = Vec3d(p) + offset;
                run.worst =
                    std::max(run.worst, std::abs(double(block.value(0, p)) - (at.x + 2 * at.y - at.z)));
            }
    return run;
}

TEST(PublishedMethods, CoverTheInsideOfAConformingMeshAndGiveNearlyTheSameValues) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    const IndexBox inside{Vec3i(1),
                          Vec3i(28)};  // away from the boundary, where the fill rule may drop points
    const PublishedRun hybrid = runPublished(Hybrid2001Resampler(), inside);
    const PublishedRun slicing = runPublished(Slicing2001Resampler(), inside);
    EXPECT_EQ(hybrid.covered, inside.count());  // its polygons fit
    EXPECT_LT(hybrid.worst, 0.05);
    EXPECT_GT(slicing.covered, inside.count() - 20);  // its alpha test may lose points on shared faces
    EXPECT_LT(slicing.worst, 0.05);
}

TEST(PublishedMethods, MissAKnownNumberOfPoints) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    if (!glDeviceInfo(GlPlatform::eglSurfaceless).isSoftware) GTEST_SKIP() << "known for the emulated device";
    const IndexBox all{Vec3i(-1), Vec3i(32)};
    // The sides of the box lie on the lattice.
    EXPECT_EQ(runPublished(SlicingResampler(), all, 0).covered, 31 * 31 * 31);
    EXPECT_EQ(31 * 31 * 31 - runPublished(Slicing2001Resampler(), all, 0).covered, 2100);
    // The fill rule drops the three upper sides.
    EXPECT_EQ(31 * 31 * 31 - runPublished(Hybrid2001Resampler(), all, 0).covered,
              31 * 31 * 31 - 30 * 30 * 30);
}

}  // namespace
}  // namespace tessera
