// Fragments that are never generated are holes: every lattice point that an element covers must lie in a
// primitive of the generators, further inside than the rasteriser's snapping can move an edge. The same holds
// for the points beside it that the fragment's rule would accept: else it would depend on where a region
// ends, and on the generator, which of them are covered.

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <tuple>

#include "gl/gl_platform.h"
#include "gl/gl_thread.h"
#include "hybrid/slice_polygon_generator.h"
#include "raster/prepared_region.h"
#include "raster/primitive_maker.h"
#include "raster/regions.h"
#include "raster_elements.h"
#include "reference/reference_block.h"
#include "slicing/silhouette_generator.h"

namespace tessera {
namespace {

using rastertest::rounds;
using rastertest::Zoo;

/// What a corner may be moved by snapping to 2^-8 pixel, and what clipping and float add, in pixels.
constexpr double kSnapping = 0x1p-8;

constexpr int kLayersASlab = 8;

/// All that a generator emits for an element in one layer.
struct Emitted {
    std::vector<Sprite> sprites;
    std::vector<std::vector<std::array<double, 2>>> polygons;
};

using ElementLayer = std::tuple<ShapeGrade, std::uint32_t, std::uint32_t>;  // grade, record, layer

void sortPrimitives(const PrimitiveList& list, ShapeGrade grade, std::map<ElementLayer, Emitted>& sorted) {
    for (const Sprite& sprite : list.sprites)
        sorted[{grade, sprite.record, sprite.layer}].sprites.push_back(sprite);
    ASSERT_EQ(list.corners.size() % 4, 0u);
    for (std::size_t i = 0; i < list.corners.size(); i += 4) {
        const PolygonVertex& provoking = list.corners[i];
        std::vector<std::array<double, 2>> polygon;
        for (std::size_t k = i; k < i + 4; ++k) {
            const PolygonVertex& v = list.corners[k];
            ASSERT_EQ(std::tie(v.record, v.layer), std::tie(provoking.record, provoking.layer));
            const std::array<double, 2> corner{double(v.s), double(v.t)};
            if (k == i + 3 && corner == polygon.back()) continue;  // of a triangle it stands twice
            polygon.push_back(corner);
        }
        sorted[{grade, provoking.record, provoking.layer}].polygons.push_back(std::move(polygon));
    }
}

/// Distance of a place from the nearest edge of a convex polygon, negative outside or where it isn't convex.
double depthIn(const std::vector<std::array<double, 2>>& polygon, double s, double t) {
    const std::size_t n = polygon.size();
    double least = INFINITY, area = 0;
    for (std::size_t k = 0; k < n; ++k) {
        const auto &a = polygon[k], &b = polygon[(k + 1) % n];
        area += a[0] * b[1] - a[1] * b[0];
    }
    for (std::size_t k = 0; k < n; ++k) {
        const auto &a = polygon[k], &b = polygon[(k + 1) % n];
        const double ds = b[0] - a[0], dt = b[1] - a[1];
        const double cross = ds * (t - a[1]) - dt * (s - a[0]);
        least = std::min(least, (area < 0 ? -cross : cross) / std::hypot(ds, dt));
    }
    return least;
}

bool holds(const Emitted& primitives, int s, int t) {
    for (const Sprite& sprite : primitives.sprites)
        if (s >= sprite.s && t >= sprite.t && s < sprite.s + sprite.edge && t < sprite.t + sprite.edge)
            return true;
    for (const auto& polygon : primitives.polygons)
        if (depthIn(polygon, s + 0.5, t + 0.5) >= kSnapping) return true;
    return false;
}

std::map<ElementLayer, Emitted> generate(const SliceGenerator& generator, const PreparedRegion& region,
                                         const SliceAxes& axes) {
    const ActiveElements active = listActiveElements(region, axes, kLayersASlab);
    const Vec3i size = region.points.size();
    std::map<ElementLayer, Emitted> sorted;
    for (std::size_t slab = 0; slab < active.slabCount(); ++slab) {
        const int first = int(slab) * kLayersASlab, last = std::min(first + kLayersASlab, size[axes.l]);
        SliceBatch batch;
        SlabInput input{};
        input.axes = axes;
        input.size = size;
        input.layerBegin = first;
        input.layerEnd = last;
        input.elements = region.elements;
        input.active = active.of(slab);
        generator.emit(input, batch);
        std::map<ElementLayer, Emitted> ofSlab;
        sortPrimitives(batch.easy, ShapeGrade::easy, ofSlab);
        sortPrimitives(batch.thin, ShapeGrade::thin, ofSlab);
        for (auto& [key, primitives] : ofSlab) {
            const auto layer = int(std::get<2>(key));
            EXPECT_TRUE(layer >= first && layer < last) << "a slice belongs to one slab";
            EXPECT_EQ(primitives.sprites.size() + primitives.polygons.size(), 1u) << "one primitive a slice";
            sorted.insert_or_assign(key, std::move(primitives));
        }
    }
    return sorted;
}

/// What the device makes of a whole mesh for the same; elements stand in place of records. None without
/// OpenGL.
class DeviceGenerator {
  public:
    DeviceGenerator() {
        const std::vector<GlPlatform> platforms = availableGlPlatforms();
        if (platforms.empty()) return;
        thread_ = &sharedGlThread(platforms.front());
        makers_ = std::shared_ptr<Makers>(new Makers, [thread = thread_](Makers* makers) {
            thread->run([makers](GlContext&) { delete makers; });
        });
    }
    bool isThere() const { return makers_ != nullptr; }

    void take(const TetMesh& mesh, const Lattice& lattice) {
        const DeviceMesh::Source source(mesh, {}, SampleFormat::r32f, {});
        thread_->run([&](GlContext& context) {
            makers_->mesh.emplace(context, source);
            makers_->records.place(context, *makers_->mesh, lattice);
        });
    }

    std::map<ElementLayer, Emitted> generate(const SliceGenerator& generator, const IndexBox& box,
                                             const SliceAxes& axes) {
        return thread_->run([&](GlContext& context) { return generate(context, generator, box, axes); });
    }

  private:
    struct Makers {
        RecordMaker records;
        PrimitiveMaker primitives;
        std::optional<DeviceMesh> mesh;
    };

    std::map<ElementLayer, Emitted> generate(GlContext& context, const SliceGenerator& generator,
                                             const IndexBox& box, const SliceAxes& axes) {
        RecordMaker& records = makers_->records;
        records.findNear(context, *makers_->mesh, box);
        const RecordMaker::Made made =
            records.makeGeometry(context, *makers_->mesh, std::int64_t(1) << 40, axes.l).value();
        const std::vector<std::int32_t> listed = records.listed(context);
        std::map<std::uint32_t, std::int32_t> elementOf;  // rank
        const std::vector<ScanBox> boxes = records.boxes(context);
        for (std::size_t slot = 0; slot < boxes.size(); ++slot) elementOf[boxes[slot].rank] = listed[slot];
        std::map<ElementLayer, Emitted> sorted;
        for (const PrimitiveMaker::Slab& slab : PrimitiveMaker::slabs(made.layers, 1 << 14))
            for (std::uint32_t kind = 0; kind < kKinds; ++kind) {
                if (slab.counts[kind] == 0) continue;
                const auto primitives = makers_->primitives.make(context, records, *makers_->mesh, axes,
                                                                 generator.shader(), slab, kind);
                PrimitiveList list;
                const auto read = [&](auto& items, std::size_t count) {
                    items.resize(count);
                    context.functions().GetNamedBufferSubData(
                        primitives.buffer, 0, GLsizeiptr(count * sizeof(items[0])), items.data());
                    std::uint32_t last = 0;
                    for (auto& item : items) {
                        EXPECT_GE(item.record, last) << "by ascending records";
                        last = item.record;
                        item.record = std::uint32_t(elementOf.at(kind << kRankKindShift | item.record));
                    }
                };
                if (isLargeKind(kind))
                    read(list.corners, 4 * primitives.count);
                else
                    read(list.sprites, primitives.count);
                sortPrimitives(list, isThinKind(kind) ? ShapeGrade::thin : ShapeGrade::easy, sorted);
            }
        for (const auto& [key, primitives] : sorted)
            EXPECT_EQ(primitives.sprites.size() + primitives.polygons.size(), 1u) << "one primitive a slice";
        return sorted;
    }

    GlThread* thread_ = nullptr;
    std::shared_ptr<Makers> makers_;
};

struct Tally {
    std::int64_t held = 0, lost = 0, beside = 0;
    std::int64_t easy = 0, thin = 0, hard = 0, sprites = 0, polygons = 0;
};

/// What the shaders need to run safely.
void expectWithinTarget(const std::map<ElementLayer, Emitted>& sorted, const Vec3i& size,
                        const SliceAxes& axes, Tally& tally) {
    for (const auto& [key, primitives] : sorted) {
        for (const Sprite& sprite : primitives.sprites) {
            EXPECT_TRUE(sprite.edge >= 1 && sprite.edge <= kSmallExtent + 1) << sprite.edge;
            EXPECT_TRUE(int(sprite.s) < size[axes.s] && int(sprite.t) < size[axes.t]);
        }
        tally.sprites += std::int64_t(primitives.sprites.size());
        tally.polygons += std::int64_t(primitives.polygons.size());
    }
}

std::string describe(const TetMesh& mesh, std::int32_t element, const Vec3i& p, const SliceAxes& axes) {
    std::string text = "point " + std::to_string(p.x) + " " + std::to_string(p.y) + " " +
                       std::to_string(p.z) + ", layers along " + std::to_string(axes.l) + ", nodes";
    for (const std::int32_t n : mesh.tets[std::size_t(element)])
        for (int a = 0; a < 3; ++a) {
            char number[40];
            std::snprintf(number, sizeof number, " %a", mesh.points[std::size_t(n)][a]);
            text += number;
        }
    return text;
}

/// Checks every point that an element covers in the region, for both generators, by processor and device, and
/// the three axes.
void checkMesh(const TetMesh& mesh, const Lattice& lattice, const IndexBox& box, Tally& tally) {
    static DeviceGenerator& device = *new DeviceGenerator;  // lives as long as its thread
    const bool isOnDevice = device.isThere() && lattice.isAxisParallel();
    if (isOnDevice) device.take(mesh, lattice);
    const NodeFrame frame = frameNodes(mesh, lattice, {});
    const Oracle oracle(mesh, lattice);
    const ReferenceBlock reference = referenceBlock(oracle, box, {.toleranceVoxels = kLargestMargin});
    for (int axis = 0; axis < 3; ++axis) {
        const SliceAxes axes = SliceAxes::along(axis);
        const rastertest::NumberedRegion numbered(mesh, frame, box, axes);
        const PreparedRegion& region = numbered.region();
        for (const SliceElement& e : region.elements)
            ++(e.grade == ShapeGrade::easy ? tally.easy : tally.thin);
        tally.hard += std::int64_t(region.hard.size());
        const SilhouetteGenerator silhouettes;
        const SlicePolygonGenerator polygons;
        for (const SliceGenerator* generator : {static_cast<const SliceGenerator*>(&silhouettes),
                                                static_cast<const SliceGenerator*>(&polygons)}) {
            for (const bool byDevice : {false, true}) {
                if (byDevice && !isOnDevice) continue;
                const auto sorted =
                    byDevice ? device.generate(*generator, box, axes) : generate(*generator, region, axes);
                expectWithinTarget(sorted, box.size(), axes, tally);
                Vec3i p;
                std::size_t offset = 0;
                for (p.z = box.min.z; p.z < box.max.z; ++p.z)
                    for (p.y = box.min.y; p.y < box.max.y; ++p.y)
                        for (p.x = box.min.x; p.x < box.max.x; ++p.x, ++offset)
                            for (const Candidate& candidate : reference.candidatesOf(offset)) {
                                if (numbered.isHard(candidate.element)) continue;
                                const SliceElement* e = numbered.find(candidate.element);
                                const Vec3i at = p - box.min;
                                const bool isAccepted =
                                    e && rastertest::fragmentOf(region, *e, at).isAccepted();
                                if (!candidate.contains && !isAccepted) continue;
                                tally.beside += !candidate.contains;
                                const auto found =
                                    e ? sorted.find({e->grade,
                                                     byDevice ? std::uint32_t(candidate.element) : e->record,
                                                     std::uint32_t(at[axes.l])})
                                      : sorted.end();
                                if (found != sorted.end() && holds(found->second, at[axes.s], at[axes.t])) {
                                    ++tally.held;
                                    continue;
                                }
                                if (++tally.lost <= 3)
                                    ADD_FAILURE() << (generator == &polygons ? "hybrid" : "slicing")
                                                  << (byDevice ? " on the device" : "") << " loses "
                                                  << describe(mesh, candidate.element, p, axes);
                            }
            }
        }
    }
}

class GeneratorsOf : public testing::TestWithParam<Zoo> {};

const Lattice kUnit = Lattice::axisParallel({0, 0, 0}, 1);

TEST_P(GeneratorsOf, LoseNoCoveredPointOfElementsUpToAHundredVoxels) {
    Tally tally;
    std::uint64_t seed = 1000 * std::uint64_t(GetParam());
    for (const double size : {0.5, 2.0, 7.0, 24.0, 100.0})
        for (int round = 0; round < rounds(4); ++round) {
            // Elements stick out of the region on all sides.
            const IndexBox box{{-17, 3, -9}, {7, 27, 16}};
            const int count = size > 50 ? 60 : size > 10 ? 250 : 800;
            checkMesh(
                rastertest::zooMesh(GetParam(), count, ++seed, size, Vec3d(box.min) - 1.0, Vec3d(box.max)),
                kUnit, box, tally);
        }
    EXPECT_EQ(tally.lost, 0);
    EXPECT_GT(tally.held, 1000);
    EXPECT_GT(tally.easy + tally.thin, 300);
    EXPECT_GT(tally.sprites, 100);
    EXPECT_GT(tally.polygons, 100);
}

TEST_P(GeneratorsOf, LoseNoCoveredPointOfElementsLongerThanCells) {
    Tally tally;
    std::uint64_t seed = 7000 + 1000 * std::uint64_t(GetParam());
    for (const double size : {300.0, 900.0, 1500.0, 6000.0}) {
        const IndexBox box{{240, -256, 500}, {256, -240, 512}};
        for (int round = 0; round < rounds(2); ++round)
            checkMesh(rastertest::zooMesh(GetParam(), 60, ++seed, size, Vec3d(box.min) - 1.0, Vec3d(box.max)),
                      kUnit, box, tally);
    }
    EXPECT_EQ(tally.lost, 0);
    EXPECT_GT(tally.held, 50);
}

TEST_P(GeneratorsOf, LoseNoCoveredPointFarFromIndexZeroAndOnTurnedLattices) {
    Tally tally;
    const std::uint64_t seed = 17000 + 1000 * std::uint64_t(GetParam());
    const IndexBox near{{0, 0, 0}, {20, 20, 20}};
    const TetMesh mesh = rastertest::zooMesh(GetParam(), 400, seed, 9, Vec3d(-1), Vec3d(20));
    // The same elements, their lattice's index 0 a billion voxels away.
    const int away = 1'000'000'000;
    checkMesh(mesh, Lattice::axisParallel(Vec3d(-double(away)), 1), {near.min + away, near.max + away},
              tally);
    const Lattice turned{{20, -3, 1}, {-0.6, 0.8, 0.1}, {0.8, 0.5, -0.2}, {0.1, 0.3, 1.9}};
    checkMesh(mesh, turned, {{-2, -2, -2}, {22, 22, 12}}, tally);
    EXPECT_EQ(tally.lost, 0);
    EXPECT_GT(tally.held, 50);
}

INSTANTIATE_TEST_SUITE_P(Zoo, GeneratorsOf, testing::ValuesIn(rastertest::kZoo),
                         [](const testing::TestParamInfo<Zoo>& param) {
                             return std::string(nameOf(param.param));
                         });

}  // namespace
}  // namespace tessera
