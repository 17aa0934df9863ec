#include "device/device_samples.h"
#include "resample/statistic_names.h"
#include "tessera/lattice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <numeric>
#include <utility>

#include "compute/compute_resampler.h"
#include "gl/gl_platform.h"
#include "gl_test_tools.h"
#include "hybrid/hybrid_resampler.h"
#include "reference/fields.h"
#include "reference/generators.h"
#include "slicing/slicing_resampler.h"
#include "software/software_resampler.h"
#include "tessera/error.h"

namespace tessera {
namespace {

TetMesh meshWithFields() {
    TetMesh mesh = boxMesh({.cells = {4, 4, 4}, .sizeWorld = {280, 12, 11}, .jitter = 0.2});
    addPointField(mesh, "linear",
                  {[](const Vec3d& p) { return p.x - 2 * p.y; }, [](const Vec3d& p) { return p.z; }});
    addRandomField(mesh, "pressure", FieldLocation::point, 1, 101325, 1, 3);
    addHoledCopy(mesh, 1, "holed", 50);
    addRandomField(mesh, "cells", FieldLocation::cell, 2, 0, 1, 4);
    return mesh;
}

/// What stands in the slot of a box: the codes of a group and, where the format has it, its coverage.
struct SlotContent {
    std::vector<float> codes;
    std::vector<std::uint8_t> coverage;
};
SlotContent readSlot(const TextureSlots& slots, std::size_t box, std::size_t group, const Vec3i& size) {
    const std::size_t components = slots.channelsOf(group) <= 1 ? 1 : 4;
    const auto count = std::size_t(size.x) * std::size_t(size.y) * std::size_t(size.z);
    SlotContent content;
    content.codes.resize(count * components);
    content.coverage.resize(needsCoverageTexture(slots.format()) ? count : 0);
    slots.thread().run([&](GlContext& context) {
        const GlFunctions& gl = context.functions();
        const SlotPlace place = slots.place(box, group);
        const auto read = [&](const GlTexture& texture, GLenum format, GLenum type, auto& to) {
            gl.GetTextureSubImage(texture.id(), 0, place.at.x, place.at.y, place.at.z, size.x, size.y, size.z,
                                  format, type, GLsizei(to.size() * sizeof to[0]), to.data());
        };
        read(*place.codes, components == 1 ? GL_RED : GL_RGBA, GL_FLOAT, content.codes);
        if (!content.coverage.empty()) read(*place.coverage, GL_RED, GL_UNSIGNED_BYTE, content.coverage);
    });
    return content;
}

/// Checks the slots of all boxes against blocks. @param step what a code may differ by; 0: bit for bit.
void expectBlocks(const TextureSlots& slots, std::span<const Block> blocks, double step) {
    const SampleMarks marks = sampleMarks(slots.format());
    std::int64_t covered = 0, invalid = 0, wrong = 0;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
        const Block& block = blocks[b];
        for (std::size_t group = 0; group < slots.groupCount(); ++group) {
            const SlotContent content = readSlot(slots, b, group, block.box.size());
            const std::size_t components = slots.channelsOf(group) <= 1 ? 1 : 4;
            for (int c = 0; c < slots.channelsOf(group); ++c) {
                const std::size_t channel = group * kChannelsAGroup + std::size_t(c);
                const ValueCoding& coding = slots.codings()[channel];
                for (std::size_t i = 0; i < block.count(); ++i) {
                    const float code = content.codes[i * components + std::size_t(c)];
                    const bool hasCoverage = !content.coverage.empty();
                    const bool isCovered = hasCoverage ? content.coverage[i] != 0 : code != marks.uncovered;
                    wrong += isCovered != (block.coverage[i] != 0);
                    if (!isCovered || block.coverage[i] == 0) continue;
                    ++covered;
                    const float expected = block.channel(int(channel))[i];
                    const bool isInvalid =
                        hasCoverage ? ((content.coverage[i] - 1) >> c) & 1 : code >= marks.invalidFrom;
                    invalid += isInvalid;
                    wrong += isInvalid != std::isnan(expected);
                    if (isInvalid || std::isnan(expected)) continue;
                    if (step == 0)
                        wrong += coding.decode(code) != expected;
                    else
                        wrong += !(std::abs(double(code) - coding.encode(double(expected))) <= step);
                }
            }
        }
    }
    EXPECT_GT(covered, 100000);
    EXPECT_GT(invalid, 100);
    EXPECT_EQ(wrong, 0);
}

/// One texture for all slots, as a pool has.
class SharedTexture : public TextureSlots {
  public:
    SharedTexture(GlThread& thread, std::vector<ValueCoding> codings, const Vec3i& slotSize, int slots)
        : TextureSlots(thread, std::move(codings), SampleFormat::r16), slotSize_(slotSize) {
        thread.run([&](GlContext& context) {
            for (std::size_t group = 0; group < groupCount(); ++group) {
                codes_.emplace_back(context, GL_TEXTURE_3D, textureFormat(format(), channelsOf(group)),
                                    slotSize.x, slotSize.y, slotSize.z * slots);
                coverage_.emplace_back(context, GL_TEXTURE_3D, GL_R8, slotSize.x, slotSize.y,
                                       slotSize.z * slots);
            }
        });
    }
    ~SharedTexture() override {
        thread().run([&](GlContext&) { codes_.clear(), coverage_.clear(); });
    }
    SlotPlace place(std::size_t box, std::size_t group) const override {
        return {&codes_[group], &coverage_[group], {0, 0, int(box) * slotSize_.z}};
    }

  private:
    Vec3i slotSize_;
    std::vector<GlTexture> codes_, coverage_;
};

class DeviceSlotsTest : public testing::Test {
  protected:
    DeviceSlotsTest() : mesh(meshWithFields()), fields(mesh.fields.size()) {
        std::iota(fields.begin(), fields.end(), 0);
    }
    std::vector<Block> blocksBy(BoundResampler& bound) const {
        std::vector<Block> blocks(boxes.size());
        bound.resample(lattice, boxes, [&](std::size_t b, const Block& block) { blocks[b] = block; }, {});
        return blocks;
    }

    TetMesh mesh;
    std::vector<int> fields;
    Lattice lattice = Lattice::axisParallel({0.3, 0.2, 0.1}, 1);
    // Over several regions; beside one another; outside the mesh.
    std::vector<IndexBox> boxes{{{-2, -1, -2}, {290, 14, 13}},
                                {{5, 1, 1}, {22, 18, 18}},
                                {{22, 1, 1}, {39, 18, 18}},
                                {{400, 1, 1}, {417, 18, 18}}};
};

class SamplesOnDevice : public DeviceSlotsTest, public testing::WithParamInterface<SampleFormat> {};

TEST_P(SamplesOnDevice, AreThoseThatAreReadBack) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    const SlicingResampler slicing;
    const HybridResampler hybrid;
    const ComputeResampler compute;
    for (const Resampler* resampler : std::initializer_list<const Resampler*>{&slicing, &hybrid, &compute}) {
        const auto bound = resampler->bind(mesh, fields, {"egl-surfaceless", GetParam()});
        GlThread& thread = sharedGlThread(GlPlatform::eglSurfaceless);
        const auto slots =
            DeviceSamples::make(thread, boxes, codingsOf(mesh, fields, GetParam()), GetParam());
        ASSERT_EQ(slots->groupCount(), 2u);
        const ResampleStatistics statistics = bound->resampleToDevice(lattice, boxes, *slots, {});
        EXPECT_EQ(statistics.count(counted::readBackBytes), 0);
        expectBlocks(*slots, blocksBy(*bound), 0);
    }
}

TEST_P(SamplesOnDevice, AreUploadedByAlgorithmsOnTheProcessor) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    const auto bound = SoftwareResampler().bind(mesh, fields);
    GlThread& thread = sharedGlThread(GlPlatform::eglSurfaceless);
    const auto slots = DeviceSamples::make(thread, boxes, codingsOf(mesh, fields, GetParam()), GetParam());
    bound->resampleToDevice(lattice, boxes, *slots, {});
    // A driver may round to either side.
    const double step = GetParam() == SampleFormat::r8    ? 1.0 / 255
                        : GetParam() == SampleFormat::r16 ? 1.0 / 65535
                                                          : 0x1p-11;
    expectBlocks(*slots, blocksBy(*bound), GetParam() == SampleFormat::r32f ? 0 : step * 1.001);
}

TEST_F(DeviceSlotsTest, GoToTheirPlacesInOneTextureForAll) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    GlThread& thread = sharedGlThread(GlPlatform::eglSurfaceless);
    SharedTexture pool(thread, codingsOf(mesh, fields, SampleFormat::r16), {292, 17, 17}, 4);
    const auto bound = HybridResampler().bind(mesh, fields, {"egl-surfaceless", SampleFormat::r16});
    bound->resampleToDevice(lattice, boxes, pool, {});
    expectBlocks(pool, blocksBy(*bound), 0);
}

TEST_F(DeviceSlotsTest, WantSlotsOfTheirOwnKind) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    GlThread& thread = sharedGlThread(GlPlatform::eglSurfaceless);
    const auto bound = SlicingResampler().bind(mesh, fields, {"egl-surfaceless", SampleFormat::r8});
    const auto slots =
        DeviceSamples::make(thread, boxes, codingsOf(mesh, fields, SampleFormat::r16), SampleFormat::r16);
    EXPECT_THROW(bound->resampleToDevice(lattice, boxes, *slots, {}), InputError);
    const auto fewer = DeviceSamples::make(thread, boxes, codingsOf(mesh, std::vector{0}, SampleFormat::r8),
                                           SampleFormat::r8);
    EXPECT_THROW(bound->resampleToDevice(lattice, boxes, *fewer, {}), InputError);
}

INSTANTIATE_TEST_SUITE_P(All, SamplesOnDevice,
                         testing::Values(SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16,
                                         SampleFormat::r8),
                         [](const testing::TestParamInfo<SampleFormat>& param) {
                             return std::string(nameOf(param.param));
                         });

/// Counts the dispatches that a device is given, and the threads of them, while it lives.
class DispatchCount {
  public:
    explicit DispatchCount(GlThread& thread) : thread_(thread) {
        dispatches = 0;
        thread_.run([&](GlContext& context) {
            exchange(context, true);
            threads_ = GlQuery(context, kComputeInvocations);
            threads_.begin();
        });
    }
    ~DispatchCount() {
        thread_.run([&](GlContext& context) {
            exchange(context, false);
            threads_.reset();
        });
    }
    /// Once.
    std::uint64_t threads() {
        return thread_.run([&](GlContext&) {
            threads_.end();
            return threads_.result();
        });
    }
    static inline int dispatches = 0;

  private:
    static constexpr GLenum kComputeInvocations = 0x82F5;  // GL_ARB_pipeline_statistics_query

    static void exchange(GlContext& context, bool isCounted) {
        auto& gl = const_cast<GlFunctions&>(context.functions());
        if (isCounted) direct = gl.DispatchCompute, indirect = gl.DispatchComputeIndirect;
        gl.DispatchCompute = isCounted ? countDirect : direct;
        gl.DispatchComputeIndirect = isCounted ? countIndirect : indirect;
    }
    static void APIENTRY countDirect(GLuint x, GLuint y, GLuint z) {
        ++dispatches;
        direct(x, y, z);
    }
    static void APIENTRY countIndirect(GLintptr at) {
        ++dispatches;
        indirect(at);
    }
    static inline decltype(GlFunctions::DispatchCompute) direct = nullptr;
    static inline decltype(GlFunctions::DispatchComputeIndirect) indirect = nullptr;

    GlThread& thread_;
    GlQuery threads_;
};

TEST(ABrickOnTheDevice, CostsWhatIsNearItAndAFixedNumberOfDispatches) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    GlThread& thread = sharedGlThread(GlPlatform::eglSurfaceless);
    if (std::ranges::count(thread.info().extensions, "GL_ARB_pipeline_statistics_query") == 0)
        GTEST_SKIP() << "this device doesn't count threads";
    const auto boxOf = [](int cells, bool hasCompany) {
        TetMesh mesh = boxMesh({.cells = Vec3i(cells), .sizeWorld = Vec3d(16), .jitter = 0.2});
        if (hasCompany) {
            TetMesh company = boxMesh({.cells = Vec3i(20), .sizeWorld = Vec3d(160), .jitter = 0.2});
            for (Vec3d& point : company.points) point += 100.0;
            appendMesh(mesh, company);
        }
        return mesh;
    };
    const IndexBox brick{Vec3i(0), Vec3i(17)};
    const auto count = [&](TetMesh mesh) {
        addPointField(mesh, "linear", {[](const Vec3d& p) { return p.x; }});
        const std::vector<int> fields{0};
        const auto bound =
            ComputeResampler().bind(mesh, fields, {.target = "egl-surfaceless", .route = Route::index});
        const auto slots = DeviceSamples::make(
            thread, std::span(&brick, 1), codingsOf(mesh, fields, SampleFormat::r32f), SampleFormat::r32f);
        const Lattice lattice = Lattice::axisParallel(Vec3d(0.01), 1);
        bound->resampleToDevice(lattice, std::span(&brick, 1), *slots, {});  // compiles shaders
        DispatchCount counted(thread);
        bound->resampleToDevice(lattice, std::span(&brick, 1), *slots, {});
        return std::pair(counted.threads(), counted.dispatches);
    };
    const auto alone = count(boxOf(6, false)), inCompany = count(boxOf(6, true));
    EXPECT_EQ(inCompany, alone);
    EXPECT_GT(alone.first, 0u);
    // Large, small and thin elements, and some that the processor decides.
    TetMesh all = boxOf(2, false);
    appendMesh(all, boxOf(6, false));
    for (const double thickness : {1e-5, 1e-13}) {
        TetMesh thin = thinTetsMesh(ThinKind::sliver, thickness, 0.7, 20, 3);
        for (Vec3d& point : thin.points) point *= 16;
        appendMesh(all, thin);
    }
    TetMesh away = boxOf(3, false);
    for (Vec3d& point : away.points) point += 100.0;
    for (const TetMesh& mesh : {boxOf(1, false), boxOf(3, false), boxOf(12, false), all, away})
        EXPECT_EQ(count(mesh).second, alone.second) << mesh.elementCount();
    RecordProperty("dispatches", alone.second);
}

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
