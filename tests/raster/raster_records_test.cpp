// Records that compute shaders make against those of the processor, bit for bit.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <sstream>
#include <string>

#include "gl_test_tools.h"
#include "raster/raster_device.h"
#include "raster_run_tools.h"

namespace tessera {
namespace {

template <class T>
std::vector<T> itemsOf(GlContext& context, GLuint buffer, std::size_t count) {
    std::vector<T> items(count);
    context.functions().GetNamedBufferSubData(buffer, 0, GLsizeiptr(count * sizeof(T)), items.data());
    return items;
}

/// Words that differ; -0 and 0 are the same.
template <class Word, class T>
std::string differences(const T& made, const T& expected) {
    Word a[sizeof(T) / sizeof(Word)], b[sizeof(T) / sizeof(Word)];
    std::memcpy(a, &made, sizeof(T));
    std::memcpy(b, &expected, sizeof(T));
    std::ostringstream text;
    text.precision(17);
    for (std::size_t i = 0; i < std::size(a); ++i)
        if (a[i] != b[i]) text << " word " << i << ": " << a[i] << ", not " << b[i] << ";";
    return text.str();
}

/// What the device made for a region.
struct DeviceRecords {
    std::vector<std::int32_t> listed, hard;
    std::vector<EasyGeometry> easy;
    std::vector<ThinGeometry> thin;
    std::vector<ChannelRecord> easyChannels, thinChannels;
    std::vector<ScanBox> boxes;
};

DeviceRecords recordsOf(RasterDevice& device, const RasterInputs& inputs, const Lattice& lattice,
                        const IndexBox& box, std::size_t pass) {
    const DeviceMesh::Source source(inputs.mesh, inputs.channels, inputs.format, {});
    return device.thread().run([&](GlContext& context) {
        const DeviceMesh mesh(context, source);
        RecordMaker& maker = device.records();
        EXPECT_TRUE(maker.isExact(context));
        maker.place(context, mesh, lattice);
        maker.findNear(context, mesh, box);
        RecordMaker::Made made = maker.makeGeometry(context, mesh, std::int64_t(1) << 40).value();
        maker.makeChannels(context, mesh, pass, inputs.format);
        const ScanRecords ids = maker.records();
        DeviceRecords records;
        records.listed = maker.listed(context);
        records.hard = std::move(made.hard);
        std::size_t boxes = 0, thin = 0;
        for (const ScanRun& run : made.runs) {
            boxes += run.count;
            thin += run.isThin ? run.count : 0;
        }
        const std::size_t listed = records.listed.size(), a = std::size_t(inputs.recordedChannels(pass));
        records.easy = itemsOf<EasyGeometry>(context, ids.easyGeometry, listed);
        records.easyChannels = itemsOf<ChannelRecord>(context, ids.easyChannels, listed * a);
        records.thin = itemsOf<ThinGeometry>(context, ids.thinGeometry, thin);
        records.thinChannels = itemsOf<ChannelRecord>(context, ids.thinChannels, thin * a);
        records.boxes = itemsOf<ScanBox>(context, ids.boxes, boxes);
        return records;
    });
}

class RasterRecords : public testing::TestWithParam<GlPlatform> {
  protected:
    void SetUp() override { TESSERA_NEEDS_GL(GetParam()); }
};

TEST_P(RasterRecords, OfTheDeviceAreThoseOfTheProcessor) {
    const TetMesh mesh = rastertest::contestedMesh();
    const Lattice lattice = Lattice::axisParallel(Vec3d(0.01, -0.02, 0.003), 1.0 / 41);
    const NodeFrame frame = frameNodes(mesh, lattice, {});
    const std::shared_ptr<RasterDevice> device = rastertest::makeDevice(GetParam());
    for (const SampleFormat format : {SampleFormat::r32f, SampleFormat::r8}) {
        std::vector<ChannelCoding> codings;
        for (const auto& [field, component] : {std::pair(0, 0), std::pair(1, 0), std::pair(1, 1),
                                               std::pair(1, 2), std::pair(3, 0), std::pair(2, 0)})
            codings.emplace_back(mesh.fields[std::size_t(field)], component, format);
        const RasterInputs inputs{mesh, frame, codings, format, SliceAxes::along(2)};
        const IndexBox box{{2, -1, 3}, {41, 39, 44}};
        for (std::size_t pass = 0; pass < inputs.passCount(); ++pass) {
            const DeviceRecords made = recordsOf(*device, inputs, lattice, box, pass);
            const auto channels = std::size_t(inputs.recordedChannels(pass));
            std::vector<std::int32_t> hard;
            std::size_t thin = 0, recorded = 0;
            for (std::int32_t element = 0; element < mesh.elementCount(); ++element) {
                const PreparedRegion alone = prepareRegion(inputs, box, std::span(&element, 1), {});
                hard.insert(hard.end(), alone.hard.begin(), alone.hard.end());
                if (alone.elements.empty()) continue;
                ++recorded;
                const auto listed = std::ranges::lower_bound(made.listed, element);
                ASSERT_TRUE(listed != made.listed.end() && *listed == element);
                const auto slot = std::size_t(listed - made.listed.begin());
                const auto expectChannels = [&](const auto& all, std::size_t at, const auto& expected) {
                    for (std::size_t c = 0; c < channels; ++c)
                        EXPECT_EQ(differences<float>(all[at * channels + c], expected[c]), "")
                            << "channel " << c << " of element " << element;
                };
                if (alone.elements[0].grade == ShapeGrade::thin) {
                    ASSERT_LT(thin, made.thin.size());
                    const ThinGeometry &a = made.thin[thin], &b = alone.thin.geometry[0];
                    EXPECT_EQ(differences<double>(a.normal, b.normal) +
                                  differences<double>(a.offset, b.offset) +
                                  differences<float>(a.base, b.base) + differences<float>(a.slack, b.slack),
                              "")
                        << "of thin element " << element;
                    expectChannels(made.thinChannels, thin++, alone.thin.channels[pass]);
                } else {
                    EXPECT_EQ(differences<float>(made.easy[slot], alone.easy.geometry[0]), "")
                        << "of easy element " << element;
                    expectChannels(made.easyChannels, slot, alone.easy.channels[pass]);
                }
            }
            EXPECT_EQ(made.hard, hard);
            EXPECT_GE(made.boxes.size(), recorded);
            EXPECT_GT(thin, 5u);
            EXPECT_GT(hard.size(), 5u);
        }
    }
}

TEST_P(RasterRecords, OfTheDeviceGiveTheBitsOfDrawings) {
    const TetMesh mesh = rastertest::contestedMesh();
    const Lattice lattice = Lattice::axisParallel(Vec3d(-0.05), 1.1 / 40);
    const IndexBox box{Vec3i(-3, -2, 0), Vec3i(41)};
    for (const SampleFormat format : {SampleFormat::r32f, SampleFormat::r16})
        for (const std::vector<int>& fields : {std::vector{0, 3, 1, 2}, {2}, {3}, {}}) {
            BindOptions options;
            options.target = std::string(nameOf(GetParam()));
            options.format = format;
            options.primitives = Primitives::processor;
            const auto drawn =
                rastertest::sampleOnce("slicing", mesh, fields, options, lattice, std::span(&box, 1));
            for (const char* algorithm : {"compute", "slicing", "hybrid"}) {
                options.primitives = Primitives::device;
                options.route = Route::pass;
                const auto made =
                    rastertest::sampleOnce(algorithm, mesh, fields, options, lattice, std::span(&box, 1));
                EXPECT_EQ(rastertest::differences(made.blocks, drawn.blocks), 0) << algorithm;
                options.route = Route::index;
                const auto gathered =
                    rastertest::sampleOnce(algorithm, mesh, fields, options, lattice, std::span(&box, 1));
                EXPECT_EQ(rastertest::differences(gathered.blocks, drawn.blocks), 0)
                    << algorithm << ", by the index";
            }
        }
}

INSTANTIATE_TEST_SUITE_P(Platforms, RasterRecords,
                         testing::Values(GlPlatform::eglSurfaceless, GlPlatform::osmesa),
                         [](const testing::TestParamInfo<GlPlatform>& param) {
                             return testNameOf(param.param);
                         });

}  // namespace
}  // namespace tessera
