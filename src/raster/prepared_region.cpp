#include "raster/prepared_region.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <type_traits>

#include "base/large_pages.h"
#include "base/parallel.h"
#include "raster/regions.h"

namespace tessera {

namespace {

constexpr std::int64_t kPreparedChunk = 2048;

/// What one chunk of elements comes to; put together in order afterwards.
struct Chunk {
    std::vector<SliceElement> elements;
    RecordList<EasyGeometry> easy;
    RecordList<ThinGeometry> thin;
    std::vector<std::int32_t> hard;
    std::int64_t emptyPairs = 0;
};

/// Boxes of more points than this are taken as they are.
constexpr int kMostTightened = 216;

}  // namespace

bool placeInRegion(const ElementShape& shape, const IndexBox& points, SliceElement& e) {
    const IndexBox within = pointsAbout(shape, points);
    if (within.empty()) return false;
    e.isSmall = true;
    for (int a = 0; a < 3; ++a) {
        e.first[a] = std::int32_t(std::clamp(double(shape.first[a]) - points.min[a], -0x1p31, 0x1p31 - 1));
        e.low[a] = std::int16_t(within.min[a] - points.min[a]);
        e.high[a] = std::int16_t(within.max[a] - points.min[a] - 1);
        e.isSmall = e.isSmall && shape.high[a] - shape.low[a] <= kSmallExtent;
        for (int k = 0; k < 4; ++k) e.node[k][a] = float(shape.node[k][a]);
    }
    e.grade = shape.grade;
    e.margin = float(shape.margin);
    return true;
}

namespace {

template <class Geometry>
void recordGeometry(const ElementShape& shape, const double (&base)[3], const Vec3i& regionMin,
                    Geometry& geometry) {
    using Real = std::remove_reference_t<decltype(geometry.offset[0])>;
    for (int face = 0; face < 4; ++face) {
        double at = shape.offset[face];
        for (int a = 0; a < 3; ++a) {
            geometry.normal[a][face] = Real(shape.normal[face][a]);
            at += shape.normal[face][a] * base[a];
        }
        geometry.offset[face] = Real(at);
    }
    for (int a = 0; a < 3; ++a)
        geometry.base[a] = float(double(shape.first[a]) + base[a] - double(regionMin[a]));
    geometry.slack = float(shape.slack) * kSlackFactor;
}

/// False when a channel's values need the processor.
template <class Geometry>
bool recordElement(const RasterInputs& inputs, std::int32_t element, const ElementShape& shape,
                   const IndexBox& points, SliceElement& e, RecordList<Geometry>& list) {
    // Coefficients are relative to the element's first voxel or, in elements that begin before the region's
    // cell, to the cell's first point: short arms, and the same wherever in the cell the region lies.
    const Vec3i cell = cellOrigin(points);
    double base[3];
    for (int a = 0; a < 3; ++a) base[a] = std::max(0.0, double(cell[a]) - double(shape.first[a]));
    // Passes must not disagree about who decides, or the channels of a point could be of different elements.
    for (const ChannelCoding& coding : inputs.channels)
        if (!isSafeOnDevice(coding, inputs.mesh, element)) return false;
    const float invalid = sampleMarks(inputs.format).invalid;
    for (std::size_t c = 0; c < inputs.channels.size(); ++c)
        recordChannel(inputs.channels[c], inputs.mesh, element, shape, base, invalid,
                      list.channels[c / kChannelsAPass].emplace_back());
    if (inputs.channels.empty()) list.channels[0].push_back({});
    e.record = std::uint32_t(list.geometry.size());
    recordGeometry(shape, base, points.min, list.geometry.emplace_back());
    return true;
}

/// Shrinks the box of an element with few points to those it may cover; false when there are none. Tells
/// only points apart from which every arithmetic of a fragment is sure that they are outside.
bool tighten(const ElementShape& shape, const Vec3i& regionMin, SliceElement& e) {
    const int size[3] = {e.high[0] - e.low[0] + 1, e.high[1] - e.low[1] + 1, e.high[2] - e.low[2] + 1};
    if (shape.grade == ShapeGrade::hard || size[0] * size[1] * size[2] > kMostTightened) return true;
    double corner[3];
    for (int a = 0; a < 3; ++a) corner[a] = double(regionMin[a]) + e.low[a] - double(shape.first[a]);
    double atCorner[4];
    for (int f = 0; f < 4; ++f)
        atCorner[f] = shape.offset[f] + shape.normal[f][0] * corner[0] + shape.normal[f][1] * corner[1] +
                      shape.normal[f][2] * corner[2] + 4 * shape.slack;
    double rowRise[4];  // the most that a distance gains along a row
    for (int f = 0; f < 4; ++f) rowRise[f] = std::max(0.0, shape.normal[f][0] * (size[0] - 1));
    int low[3] = {size[0], size[1], size[2]}, high[3] = {-1, -1, -1};
    for (int z = 0; z < size[2]; ++z)
        for (int y = 0; y < size[1]; ++y) {
            double inRow[4];
            bool isRowOutside = false;
            for (int f = 0; f < 4; ++f) {
                inRow[f] = atCorner[f] + shape.normal[f][1] * y + shape.normal[f][2] * z;
                isRowOutside |= inRow[f] + rowRise[f] < 0;
            }
            if (isRowOutside) continue;
            for (int x = 0; x < size[0]; ++x) {
                bool isOutside = false;
                for (int f = 0; f < 4; ++f) isOutside |= inRow[f] + shape.normal[f][0] * x < 0;
                if (isOutside) continue;
                low[0] = std::min(low[0], x), high[0] = std::max(high[0], x);
                low[1] = std::min(low[1], y), high[1] = std::max(high[1], y);
                low[2] = std::min(low[2], z), high[2] = z;
            }
        }
    for (int a = 0; a < 3; ++a) {
        e.high[a] = std::int16_t(e.low[a] + high[a]);
        e.low[a] = std::int16_t(e.low[a] + low[a]);
    }
    return high[0] >= 0;
}

/// Nearly all elements are easy.
void reserve(const RasterInputs& inputs, std::size_t count, std::vector<SliceElement>& elements,
             RecordList<EasyGeometry>& easy, RecordList<ThinGeometry>& thin) {
    reserveLarge(elements, count);
    reserveLarge(easy.geometry, count);
    easy.channels.resize(inputs.passCount());
    thin.channels.resize(inputs.passCount());
    for (std::size_t pass = 0; pass < inputs.passCount(); ++pass)
        reserveLarge(easy.channels[pass], count * std::size_t(inputs.recordedChannels(pass)));
}

void prepareChunk(const RasterInputs& inputs, const IndexBox& points, std::span<const std::int32_t> elements,
                  Chunk& chunk) {
    reserve(inputs, elements.size(), chunk.elements, chunk.easy, chunk.thin);
    for (std::size_t i = 0; i < elements.size(); ++i) {
        if (i + 8 < elements.size())
            for (const std::int32_t node : inputs.mesh.tets[std::size_t(elements[i + 8])])
                __builtin_prefetch(&inputs.frame.nodes[std::size_t(node)]);
        const std::int32_t element = elements[i];
        const ElementShape shape = shapeElement(inputs.mesh, inputs.frame, element);
        SliceElement e{};
        if (!placeInRegion(shape, points, e)) continue;
        const int slices = e.high[inputs.axes.l] - e.low[inputs.axes.l] + 1;
        const bool mayCover = tighten(shape, points.min, e);
        chunk.emptyPairs += slices - (mayCover ? e.high[inputs.axes.l] - e.low[inputs.axes.l] + 1 : 0);
        if (!mayCover) continue;
        const bool isRecorded =
            shape.grade == ShapeGrade::easy   ? recordElement(inputs, element, shape, points, e, chunk.easy)
            : shape.grade == ShapeGrade::thin ? recordElement(inputs, element, shape, points, e, chunk.thin)
                                              : false;
        if (isRecorded)
            chunk.elements.push_back(e);
        else
            chunk.hard.push_back(element);
    }
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
    to.insert(to.end(), from.begin(), from.end());
}

template <class Geometry>
void append(RecordList<Geometry>& to, const RecordList<Geometry>& from) {
    append(to.geometry, from.geometry);
    for (std::size_t pass = 0; pass < to.channels.size(); ++pass)
        append(to.channels[pass], from.channels[pass]);
}

}  // namespace

PreparedRegion prepareRegion(const RasterInputs& inputs, const IndexBox& points,
                             std::span<const std::int32_t> elements, const Execution& execution) {
    const auto count = std::int64_t(elements.size());
    std::vector<Chunk> chunks(std::size_t((count + kPreparedChunk - 1) / kPreparedChunk));
    parallelForChunks(execution, count, kPreparedChunk, [&](std::int64_t begin, std::int64_t end) {
        prepareChunk(inputs, points, elements.subspan(std::size_t(begin), std::size_t(end - begin)),
                     chunks[std::size_t(begin / kPreparedChunk)]);
    });
    PreparedRegion region;
    region.points = points;
    reserve(inputs, elements.size(), region.elements, region.easy, region.thin);
    for (Chunk& chunk : chunks) {
        for (SliceElement e : chunk.elements) {
            e.record += std::uint32_t(e.grade == ShapeGrade::easy ? region.easy.geometry.size()
                                                                  : region.thin.geometry.size());
            region.elements.push_back(e);
        }
        append(region.easy, chunk.easy);
        append(region.thin, chunk.thin);
        append(region.hard, chunk.hard);
        region.emptyPairs += chunk.emptyPairs;
        chunk = {};
    }
    return region;
}

ActiveElements listActiveElements(const PreparedRegion& region, const SliceAxes& axes, int layersASlab) {
    ActiveElements active;
    active.layersASlab = layersASlab;
    const int layers = region.points.size()[axes.l];
    active.first.assign(std::size_t((layers + layersASlab - 1) / layersASlab) + 1, 0);
    for (const SliceElement& e : region.elements)
        for (int slab = e.low[axes.l] / layersASlab; slab <= e.high[axes.l] / layersASlab; ++slab)
            ++active.first[std::size_t(slab) + 1];
    for (std::size_t s = 1; s < active.first.size(); ++s) active.first[s] += active.first[s - 1];
    active.slots.resize(std::size_t(active.first.back()));
    std::vector<std::int64_t> next(active.first.begin(), active.first.end() - 1);
    for (std::size_t slot = 0; slot < region.elements.size(); ++slot) {
        const SliceElement& e = region.elements[slot];
        for (int slab = e.low[axes.l] / layersASlab; slab <= e.high[axes.l] / layersASlab; ++slab)
            active.slots[std::size_t(next[std::size_t(slab)]++)] = std::int32_t(slot);
    }
    return active;
}

int chooseLayerAxis(const TetMesh& mesh, const NodeFrame& frame, const Execution& execution) {
    std::atomic<std::int64_t> pairs[3] = {0, 0, 0};
    parallelForChunks(execution, mesh.elementCount(), 16384, [&](std::int64_t begin, std::int64_t end) {
        std::int64_t sums[3] = {0, 0, 0};
        for (std::int64_t i = begin; i < end; ++i) {
            const auto& tet = mesh.tets[std::size_t(i)];
            for (int a = 0; a < 3; ++a) {
                float low = INFINITY, high = -INFINITY;
                for (const std::int32_t node : tet) {
                    const float at = frame.rough[std::size_t(node)].index[a];
                    low = std::min(low, at);
                    high = std::max(high, at);
                }
                // In units of 2^-10 slice, so that sums are whole and don't depend on their order.
                sums[a] += std::int64_t(std::min((high - low) * 0x1p10f, 0x1p40f));
            }
        }
        for (int a = 0; a < 3; ++a) pairs[a] += sums[a];
    });
    return layerAxisOf({double(pairs[0]), double(pairs[1]), double(pairs[2])});
}

int layerAxisOf(const Vec3d& pairs) {
    int best = 2;
    for (const int a : {1, 0})
        if (pairs[a] < 0.875 * pairs[best]) best = a;
    return best;
}

}  // namespace tessera
