// The OpenGL resamplers as long-lived parts of a process: many runs, several threads, runs that are broken
// off.

#include <chrono>
#include <future>
#include <thread>

#include "base/sanitizers.h"
#include "hybrid/slice_polygon_generator.h"
#include "raster/hard_elements.h"
#include "raster/regions.h"
#include "raster_run_tools.h"
#include "resample/statistic_names.h"
#include "slicing/silhouette_generator.h"
#include "tessera/error.h"
#include "tessera/lattice.h"

namespace tessera {
namespace {

using namespace rastertest;

constexpr SampleFormat kFormats[] = {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16,
                                     SampleFormat::r8};
constexpr std::string_view kAlgorithms[] = {"slicing", "hybrid", "compute"};

BindOptions on(GlPlatform platform, SampleFormat format = SampleFormat::r32f) {
    BindOptions options;
    options.target = std::string(nameOf(platform));
    options.format = format;
    return options;
}

class RasterRuns : public testing::TestWithParam<GlPlatform> {
  protected:
    void SetUp() override { TESSERA_NEEDS_GL(GetParam()); }
};

TEST_P(RasterRuns, SamplesDontDependOnTheMemoryForThem) {
    TetMesh mesh = boxMesh({.cells = Vec3i(20), .jitter = 0.25, .seed = 3});
    addRandomField(mesh, "vectors", FieldLocation::point, 4, 0, 1, 7);
    addElementIdField(mesh, "element");
    const std::vector<int> fields{0, 1};      // two passes
    const IndexBox box{Vec3i(0), Vec3i(92)};  // one region, when there is memory
    const Lattice lattice = Lattice::axisParallel(Vec3d(-0.005), 1.0 / 90);
    for (const std::string_view algorithm : kAlgorithms) {
        BindOptions options = on(GetParam());
        const auto plenty = sampleOnce(algorithm, mesh, fields, options, lattice, std::span(&box, 1));
        options.workBytes = 1;
        const auto least = sampleOnce(algorithm, mesh, fields, options, lattice, std::span(&box, 1));
        // There were more regions, so elements were counted more often.
        EXPECT_GT(least.statistics.count(counted::elementBlockPairs),
                  plenty.statistics.count(counted::elementBlockPairs));
        ASSERT_EQ(least.blocks[0].coverage, plenty.blocks[0].coverage);
        ASSERT_EQ(least.blocks[0].values, plenty.blocks[0].values);
    }
}

TEST_P(RasterRuns, SamplesDontDependOnTheAxisOfSlices) {
    TetMesh mesh = boxMesh({.cells = Vec3i(9, 7, 5), .jitter = 0.25, .seed = 5});
    addRandomField(mesh, "f", FieldLocation::point, 1, 0, 1, 7);
    const std::vector<int> fields{0};
    const IndexBox box{Vec3i(-2), Vec3i(40, 37, 31)};
    const Lattice lattice = Lattice::axisParallel(Vec3d(-0.01), 1.0 / 33);
    for (const std::string_view algorithm : {"slicing", "hybrid"})
        for (const Primitives primitives : {Primitives::device, Primitives::processor}) {
            BindOptions options = on(GetParam());
            options.primitives = primitives;
            const auto chosen = sampleOnce(algorithm, mesh, fields, options, lattice, std::span(&box, 1));
            std::vector<std::int64_t> pairs;
            for (int axis = 0; axis < 3; ++axis) {
                options.sliceAxis = axis;
                const auto along = sampleOnce(algorithm, mesh, fields, options, lattice, std::span(&box, 1));
                ASSERT_EQ(along.blocks[0].coverage, chosen.blocks[0].coverage) << algorithm << axis;
                ASSERT_EQ(along.blocks[0].values, chosen.blocks[0].values) << algorithm << axis;
                pairs.push_back(along.statistics.count(counted::elementSlicePairs));
            }
            // It is another way of drawing, and the chosen one has the fewest pairs.
            EXPECT_NE(pairs[0], pairs[2]);
            EXPECT_EQ(chosen.statistics.count(counted::elementSlicePairs),
                      *std::min_element(pairs.begin(), pairs.end()));
        }
    BindOptions options = on(GetParam());
    options.sliceAxis = 3;
    EXPECT_THROW(findResampler("slicing").bind(mesh, fields, options), InputError);
    options.sliceAxis = 0;
    EXPECT_THROW(findResampler("compute").bind(mesh, fields, options), InputError);
}

TEST_P(RasterRuns, AThousandLeakNeitherObjectsNorMemory) {
    const TetMesh mesh = smallMesh(2);
    const std::vector<int> one{0}, all{0, 1, 2};
    const IndexBox box = centredBox(8);
    const Lattice lattice = centredLattice(8);
    const auto run = [&](int i) {
        const auto sampled = sampleOnce(kAlgorithms[i / 3 % 3], mesh, i % 3 ? one : all,
                                        on(GetParam(), kFormats[i / 2 % 4]), lattice, std::span(&box, 1));
        ASSERT_GT(sampled.statistics.count(counted::coveredPoints), 400);
    };
    constexpr int kRuns = 1000, kWarmUp = 96;
    for (int i = 0; i < kWarmUp; ++i) run(i);
    const std::int64_t objects = liveObjects(GetParam());
    const std::int64_t bytes = residentBytes();
    for (int i = 0; i < kRuns; ++i) run(i);
    EXPECT_EQ(liveObjects(GetParam()), objects);
    // One texture of 64 KiB a run would be 62 MiB. The address sanitizer keeps freed memory for a while.
    if (!kIsAddressSanitized) {
        EXPECT_LT(residentBytes() - bytes, 24 << 20);
    }
}

TEST_P(RasterRuns, AThousandBindingsLeakNothing) {
    const TetMesh mesh = smallMesh(2);
    const std::vector<int> all{0, 1, 2};
    std::int64_t objects = 0, bytes = 0;
    for (int i = 0; i < 1048; ++i) {
        if (i == 48) objects = liveObjects(GetParam()), bytes = residentBytes();
        const auto bound = namedResampler(kAlgorithms[i % 3]).bind(mesh, all, on(GetParam()));
        ASSERT_EQ(bound->target(), nameOf(GetParam()));
    }
    EXPECT_EQ(liveObjects(GetParam()), objects);
    EXPECT_LT(residentBytes() - bytes, 8 << 20);
}

TEST_P(RasterRuns, SeveralThreadsUseOneBoundResampler) {
    const TetMesh mesh = smallMesh();
    const std::vector<int> all{0, 1, 2};
    for (const std::string_view algorithm : kAlgorithms) {
        const auto bound = namedResampler(algorithm).bind(mesh, all, on(GetParam()));
        std::vector<std::vector<Block>> alone;
        for (const int points : {10, 17, 24, 31}) {
            const IndexBox box = centredBox(points);
            alone.push_back(sampleBound(*bound, centredLattice(points), std::span(&box, 1)).blocks);
        }
        std::vector<std::future<std::int64_t>> threads;
        for (std::size_t t = 0; t < 4; ++t)
            threads.push_back(std::async(std::launch::async, [&, t] {
                std::int64_t differing = 0;
                const int points = int(10 + 7 * t);
                const IndexBox box = centredBox(points);
                for (int round = 0; round < 5; ++round)
                    differing += differences(
                        alone[t], sampleBound(*bound, centredLattice(points), std::span(&box, 1)).blocks);
                return differing;
            }));
        for (auto& thread : threads) EXPECT_EQ(thread.get(), 0) << algorithm;
    }
}

/// Runs algorithms at once, each on its platform, and compares with what each gives alone.
void compareAtOnce(const std::vector<std::pair<std::string_view, GlPlatform>>& runners) {
    const TetMesh mesh = smallMesh(4);
    const std::vector<int> all{0, 1, 2};
    const int points = 40;
    const Lattice lattice = centredLattice(points);
    const std::vector<IndexBox> boxes = contract::cut(centredBox(points), 16);
    std::vector<std::vector<Block>> alone;
    for (const auto& [algorithm, platform] : runners)
        alone.push_back(sampleOnce(algorithm, mesh, all, on(platform), lattice, boxes).blocks);
    std::vector<std::future<std::int64_t>> threads;
    for (std::size_t t = 0; t < runners.size(); ++t)
        threads.push_back(std::async(std::launch::async, [&, t] {
            std::int64_t differing = 0;
            for (int round = 0; round < 6; ++round)
                differing += differences(
                    alone[t],
                    sampleOnce(runners[t].first, mesh, all, on(runners[t].second), lattice, boxes).blocks);
            return differing;
        }));
    for (std::size_t t = 0; t < runners.size(); ++t)
        EXPECT_EQ(threads[t].get(), 0) << runners[t].first << " on " << nameOf(runners[t].second);
}

TEST_P(RasterRuns, AlgorithmsRunAtOnceOnOneDevice) {
    compareAtOnce(
        {{"slicing", GetParam()}, {"hybrid", GetParam()}, {"compute", GetParam()}, {"slicing", GetParam()}});
}

TEST(RasterRunsOnTwoPlatforms, GiveTheSameBitsAsAlone) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    TESSERA_NEEDS_GL(GlPlatform::osmesa);
    compareAtOnce({{"slicing", GlPlatform::eglSurfaceless},
                   {"slicing", GlPlatform::osmesa},
                   {"hybrid", GlPlatform::eglSurfaceless},
                   {"hybrid", GlPlatform::osmesa},
                   {"compute", GlPlatform::eglSurfaceless},
                   {"compute", GlPlatform::osmesa}});
}

/// Reads the region back, and waits.
RasterImage filled(RasterDevice& device, GlContext& context) {
    RasterImage image = device.readBack(context);
    device.waitFor(context, image);
    return image;
}

/// Renders one region by hand, as a run does.
RasterImage render(RasterDevice& device, const RasterInputs& inputs, const IndexBox& points,
                   const SliceGenerator& generator, const std::function<void(GlContext&)>& beforeDraws = {}) {
    std::vector<std::int32_t> elements(inputs.mesh.tets.size());
    std::iota(elements.begin(), elements.end(), 0);
    const PreparedRegion region = prepareRegion(inputs, points, elements, {});
    constexpr int kLayersASlab = 8;
    const ActiveElements active = listActiveElements(region, inputs.axes, kLayersASlab);
    const auto decided = decideHardElements(inputs, region, 0, {});
    return device.thread().run([&](GlContext& context) {
        device.begin(context, region, inputs);
        if (beforeDraws) beforeDraws(context);
        for (std::size_t slab = 0; slab < active.slabCount(); ++slab) {
            SlabInput input{};
            input.axes = inputs.axes;
            input.size = points.size();
            input.layerBegin = int(slab) * kLayersASlab;
            input.layerEnd = std::min(input.layerBegin + kLayersASlab, input.size[inputs.axes.l]);
            input.elements = region.elements;
            input.active = active.of(slab);
            SliceBatch batch;
            generator.emit(input, batch);
            device.draw(context, batch);
        }
        device.draw(context, decided);
        return filled(device, context);
    });
}

/// The same by primitives that the device makes, at most so many bytes at a time.
RasterImage renderOnDevice(RasterDevice& device, const RasterInputs& inputs, const Lattice& lattice,
                           const IndexBox& points, const SliceGenerator& generator, std::int64_t mostBytes) {
    const DeviceMesh::Source source(inputs.mesh, inputs.channels, inputs.format, {});
    return device.thread().run([&](GlContext& context) {
        const DeviceMesh mesh(context, source);
        device.records().place(context, mesh, lattice);
        device.records().findNear(context, mesh, points);
        const RecordMaker::Made made =
            device.records().makeGeometry(context, mesh, std::int64_t(1) << 40, inputs.axes.l).value();
        PreparedRegion region;
        region.points = points;
        region.hard = made.hard;
        device.begin(context, points, inputs, 0, mesh, false);
        device.draw(context, mesh, generator.shader(), made.layers, mostBytes);
        device.draw(context, decideHardElements(inputs, region, 0, {}));
        return filled(device, context);
    });
}

TEST_P(RasterRuns, LayerByLayerAndByTheDeviceGiveTheSameBits) {
    TetMesh mesh = smallMesh(2);
    // Thin and hard elements too, inside and beside the others.
    TetMesh thin = thinTetsMesh(ThinKind::sliver, 1e-5, 0.7, 20, 3);
    appendMesh(thin, thinTetsMesh(ThinKind::needle, 1e-9, 0.7, 20, 4));
    mesh.fields.clear();
    appendMesh(mesh, thin);
    addPointField(mesh, "wavy", {wavyField});
    addRandomField(mesh, "vector", FieldLocation::point, 3, 0, 1, 5);
    addHoledCopy(mesh, 0, "holed", 5);
    const int points = 22;
    const Lattice lattice = Lattice::axisParallel(Vec3d(-0.1), 1.2 / points);
    const NodeFrame frame = frameNodes(mesh, lattice, {});
    const std::shared_ptr<RasterDevice> layered = makeDevice(GetParam()), flat = makeDevice(GetParam());
    flat->forbidVertexShaderLayer();
    const SilhouetteGenerator silhouettes;
    const SlicePolygonGenerator polygons;
    for (const SampleFormat format : kFormats)
        for (const int axis : {0, 1, 2})
            for (const bool isVector : {false, true}) {
                std::vector<ChannelCoding> codings;
                for (int c = 0; c < (isVector ? 3 : 1); ++c)
                    codings.emplace_back(mesh.fields[isVector ? 1 : 2], c, format);
                const RasterInputs inputs{mesh, frame, codings, format, SliceAxes::along(axis)};
                const IndexBox box{{0, 0, 0}, {points, points + 3, points - 5}};
                for (const SliceGenerator* generator : {static_cast<const SliceGenerator*>(&silhouettes),
                                                        static_cast<const SliceGenerator*>(&polygons)}) {
                    const RasterImage a = render(*layered, inputs, box, *generator);
                    const auto expectSame = [&](const RasterImage& b, const char* how) {
                        EXPECT_TRUE(std::ranges::equal(a.coverage, b.coverage));
                        ASSERT_EQ(a.codes.size(), b.codes.size());
                        EXPECT_EQ(std::memcmp(a.codes.data(), b.codes.data(), a.codes.size() * sizeof(float)),
                                  0)
                            << nameOf(format) << ", axis " << axis << how;
                    };
                    expectSame(render(*flat, inputs, box, *generator), "");
                    for (const std::int64_t most : {1, 1 << 16, 1 << 24})
                        expectSame(renderOnDevice(*layered, inputs, lattice, box, *generator, most),
                                   ", by the device");
                    expectSame(renderOnDevice(*flat, inputs, lattice, box, *generator, 1 << 24),
                               ", by the device, layer by layer");
                    EXPECT_GT(std::ranges::count_if(
                                  a.codes, [&](float c) { return c != sampleMarks(format).uncovered; }),
                              1000);
                }
            }
}

/// Samples one region by the scan, as a run does.
RasterImage scan(RasterDevice& device, const RasterInputs& inputs, const IndexBox& points) {
    std::vector<std::int32_t> elements(inputs.mesh.tets.size());
    std::iota(elements.begin(), elements.end(), 0);
    const PreparedRegion region = prepareRegion(inputs, points, elements, {});
    const ScanBoxes boxes = listScanBoxes(region);
    const auto decided = decideHardElements(inputs, region, 0, {});
    return device.thread().run([&](GlContext& context) {
        device.begin(context, region, inputs, 0, true);
        device.scan(context, boxes, decided, 0, true);
        return filled(device, context);
    });
}

TEST_P(RasterRuns, AScanGivesTheBitsOfADrawing) {
    const TetMesh mesh = contestedMesh();
    const int points = 33;  // every eighth lies on a node's plane
    const NodeFrame frame = frameNodes(mesh, Lattice::axisParallel(Vec3d(0), 1.0 / (points - 1)), {});
    const std::shared_ptr<RasterDevice> drawing = makeDevice(GetParam()), scanning = makeDevice(GetParam()),
                                        tight = makeDevice(GetParam());
    tight->allowOneContender();
    const SilhouetteGenerator silhouettes;
    for (const SampleFormat format : kFormats)
        for (const std::vector<std::pair<std::size_t, int>>& channels :
             {std::vector<std::pair<std::size_t, int>>{{2, 0}}, {{0, 0}, {1, 0}, {1, 2}}, {}}) {
            std::vector<ChannelCoding> codings;
            for (const auto& [field, component] : channels)
                codings.emplace_back(mesh.fields[field], component, format);
            const RasterInputs inputs{mesh, frame, codings, format, SliceAxes::along(2)};
            // Contenders are listed in the first; the other is too small for that.
            for (const IndexBox& box : {IndexBox{{-2, 1, 0}, {points, points + 1, points - 5}},
                                        IndexBox{Vec3i(7), Vec3i(7 + 17)}}) {
                const RasterImage drawn = render(*drawing, inputs, box, silhouettes);
                for (RasterDevice* device : {scanning.get(), tight.get(), scanning.get()}) {
                    const RasterImage scanned = scan(*device, inputs, box);
                    EXPECT_TRUE(std::ranges::equal(scanned.coverage, drawn.coverage));
                    ASSERT_EQ(scanned.codes.size(), drawn.codes.size());
                    EXPECT_EQ(std::memcmp(scanned.codes.data(), drawn.codes.data(),
                                          drawn.codes.size() * sizeof(float)),
                              0)
                        << nameOf(format) << ", " << channels.size() << " channels"
                        << (device == tight.get() ? ", without a list" : "");
                }
            }
        }
}

TEST_P(RasterRuns, ADrawThatFailsHalfWayLeavesTheDeviceUsable) {
    const TetMesh mesh = smallMesh(2);
    const NodeFrame frame = frameNodes(mesh, centredLattice(20), {});
    const ChannelCoding coding(mesh.fields[0], 0, SampleFormat::r32f);
    const RasterInputs inputs{mesh, frame, std::span(&coding, 1), SampleFormat::r32f, SliceAxes::along(2)};
    const IndexBox box{Vec3i(-10), Vec3i(11)};
    const SilhouetteGenerator silhouettes;
    const std::shared_ptr<RasterDevice> device = makeDevice(GetParam()), other = makeDevice(GetParam());
    // A new device makes its buffers in the first draw, and making one notices what has failed before.
    const auto fail = [](GlContext& context) { context.functions().Enable(GL_INVALID_INDEX); };
    EXPECT_THROW(render(*device, inputs, box, silhouettes, fail), GlError);
    for (int round = 0; round < 2; ++round)
        EXPECT_TRUE(std::ranges::equal(render(*device, inputs, box, silhouettes).codes,
                                       render(*other, inputs, box, silhouettes).codes));
}

/// A run of several regions and boxes, whole or broken off.
class BrokenOff {
  public:
    BrokenOff(std::string_view algorithm, GlPlatform platform, SampleFormat format = SampleFormat::r32f,
              const std::vector<int>& fields = {0, 1, 2})
        : platform_(platform),
          bound_(namedResampler(algorithm).bind(mesh_, fields, on(platform, format))),
          first_(sampleBound(*bound_, lattice_, boxes_)),
          whole_(sampleBound(*bound_, lattice_, boxes_)) {}

    void run(const BlockSink& sink, const Execution& execution = {.threads = 2}) const {
        bound_->resample(lattice_, boxes_, sink, execution);
    }
    std::size_t boxCount() const { return boxes_.size(); }
    RasterDevice& device() const { return sharedRasterDevice(platform_); }

    /// The same bits and the same counts as the first time.
    void expectUsable(std::string_view after) const {
        const Sampled again = sampleBound(*bound_, lattice_, boxes_);
        EXPECT_EQ(differences(again.blocks, whole_.blocks), 0) << after;
        EXPECT_EQ(again.statistics.count(counted::vertices), whole_.statistics.count(counted::vertices))
            << after;
        EXPECT_EQ(again.statistics.count(counted::uploadBytes), whole_.statistics.count(counted::uploadBytes))
            << after;
        EXPECT_EQ(again.statistics.count(counted::readBackBytes),
                  whole_.statistics.count(counted::readBackBytes))
            << after;
        EXPECT_EQ(again.statistics.count(counted::fragments), whole_.statistics.count(counted::fragments))
            << after;
    }

  private:
    TetMesh mesh_ = smallMesh(3);
    Lattice lattice_ = centredLattice(24);
    std::vector<IndexBox> boxes_ = contract::cut(centredBox(24), 9);
    GlPlatform platform_;
    std::unique_ptr<BoundResampler> bound_;
    Sampled first_, whole_;  ///< the first puts the mesh on the device
};

const BlockSink kNobody = [](std::size_t, const Block&) {};

TEST_P(RasterRuns, CancelledRunsLeaveTheDeviceUsable) {
    for (const std::string_view algorithm : kAlgorithms) {
        const BrokenOff runs(algorithm, GetParam(),
                             algorithm == "slicing" ? SampleFormat::r16 : SampleFormat::r32f);
        std::atomic<bool> cancel{true};
        const Execution execution{.threads = 2, .cancel = &cancel};
        EXPECT_THROW(runs.run(kNobody, execution), Cancelled);
        runs.expectUsable("cancelled before");
        for (const std::size_t after : {1u, 5u, 20u}) {
            cancel = false;
            std::atomic<std::size_t> blocks{0};
            EXPECT_THROW(runs.run(
                             [&](std::size_t, const Block&) {
                                 if (++blocks == after) cancel = true;
                             },
                             execution),
                         Cancelled);
            EXPECT_LT(blocks, runs.boxCount());
            runs.expectUsable("cancelled by the sink");
        }
    }
}

/// Cancels when the given stage is reported for the n-th time.
class CancellingProgress : public ProgressSink {
  public:
    CancellingProgress(std::atomic<bool>& cancel, int after) : cancel_(cancel), after_(after) {}
    void update(Stage, std::int64_t, std::int64_t) override {
        if (--after_ == 0) cancel_ = true;
    }

  private:
    std::atomic<bool>& cancel_;
    int after_;
};

TEST_P(RasterRuns, MaybeCancelledAtAnyMomentFromAnyThread) {
    const BrokenOff runs("hybrid", GetParam());
    for (const int after : {1, 2, 3, 6}) {
        std::atomic<bool> cancel{false};
        CancellingProgress progress(cancel, after);
        EXPECT_THROW(runs.run(kNobody, {.threads = 2, .cancel = &cancel, .progress = &progress}), Cancelled);
    }
    runs.expectUsable("cancelled by progress");
    const std::int64_t objects = liveObjects(GetParam());
    int cancelled = 0;
    for (int i = 0; i < 40; ++i) {
        std::atomic<bool> cancel{false};
        std::thread canceller([&] {
            std::this_thread::sleep_for(std::chrono::microseconds(200 * i));
            cancel = true;
        });
        try {
            runs.run(kNobody, {.threads = 2, .cancel = &cancel});
        } catch (const Cancelled&) {
            ++cancelled;
        }
        canceller.join();
    }
    EXPECT_GT(cancelled, 0);
    runs.expectUsable("cancelled by another thread");
    EXPECT_EQ(liveObjects(GetParam()), objects);
}

TEST_P(RasterRuns, WhatTheSinkThrowsIsThrownAndTheDeviceStaysUsable) {
    for (const std::string_view algorithm : kAlgorithms) {
        const BrokenOff runs(algorithm, GetParam());
        for (const int threads : {1, 3})
            for (const std::size_t at : {std::size_t(0), runs.boxCount() / 2, runs.boxCount() - 1}) {
                const auto sink = [&](std::size_t b, const Block&) {
                    if (b == at) throw InputError("the sink is full");
                };
                EXPECT_THROW(runs.run(sink, {.threads = threads}), InputError);
            }
        runs.expectUsable("thrown by the sink");
    }
}

/// A region wider than any device's textures.
void beginTooLarge(RasterDevice& device, GlContext& context) {
    const TetMesh nothing;
    const NodeFrame frame;
    const RasterInputs inputs{nothing, frame, {}, SampleFormat::r32f, {}};
    PreparedRegion region;
    region.points = {{0, 0, 0}, {1 << 20, 1, 1}};
    device.begin(context, region, inputs);
}

TEST_P(RasterRuns, AfterAnOpenGlErrorTheDeviceStaysUsable) {
    for (const std::string_view algorithm : kAlgorithms) {
        // One channel, as the region that fails has: its target would be taken for the run's.
        const BrokenOff runs(algorithm, GetParam(), SampleFormat::r32f, {0});
        RasterDevice& device = runs.device();
        EXPECT_THROW(device.thread().run([&](GlContext& context) { beginTooLarge(device, context); }),
                     GlError);
        runs.expectUsable("a region that is too large");

        // In the middle of a run: its own target goes.
        std::atomic<int> blocks{0};
        try {
            runs.run([&](std::size_t, const Block&) {
                if (++blocks > 1) return;
                EXPECT_THROW(device.thread().run([&](GlContext& context) { beginTooLarge(device, context); }),
                             GlError);
            });
        } catch (const GlError&) {
        }
        EXPECT_GE(blocks, 1);
        runs.expectUsable("a run that failed");
    }
}

INSTANTIATE_TEST_SUITE_P(Platforms, RasterRuns,
                         testing::Values(GlPlatform::eglSurfaceless, GlPlatform::osmesa),
                         [](const testing::TestParamInfo<GlPlatform>& param) {
                             return testNameOf(param.param);
                         });

}  // namespace
}  // namespace tessera
