#include "slicing/silhouette_generator.h"

#include <algorithm>
#include <cmath>

#include "slicing/shaders.h"

namespace tessera {

namespace {

/// Corners of a silhouette for each set of front faces (bit j: the face opposite node j), in order around it.
/// One front face or one back face: that face. Two and two: the front faces share the edge between the nodes
/// that both have, and its ends alternate with the other two.
struct Silhouette {
    int corners;
    int node[4];
};
constexpr Silhouette kSilhouettes[16] = {
    {0, {0, 0, 0, 0}}, {3, {1, 2, 3, 0}}, {3, {0, 2, 3, 0}}, {4, {0, 2, 1, 3}},
    {3, {0, 1, 3, 0}}, {4, {0, 1, 2, 3}}, {4, {1, 0, 2, 3}}, {3, {0, 1, 2, 0}},
    {3, {0, 1, 2, 0}}, {4, {0, 1, 3, 2}}, {4, {1, 0, 3, 2}}, {3, {0, 1, 3, 0}},
    {4, {2, 0, 3, 1}}, {3, {0, 2, 3, 0}}, {3, {1, 2, 3, 0}}, {0, {0, 0, 0, 0}}};

const Silhouette& silhouetteOf(const SliceElement& e, const SliceAxes& axes) {
    unsigned front = 0;
    for (unsigned j = 0; j < 4; ++j) {
        const float* a = e.node[(j + 1) & 3];
        const float* b = e.node[(j + 2) & 3];
        const float* c = e.node[(j + 3) & 3];
        const double area =
            (double(b[axes.s]) - double(a[axes.s])) * (double(c[axes.t]) - double(a[axes.t])) -
            (double(b[axes.t]) - double(a[axes.t])) * (double(c[axes.s]) - double(a[axes.s]));
        // Taken round by one node, faces turn the other way about.
        if ((j & 1) ? area < 0 : area > 0) front |= 1u << j;
    }
    return kSilhouettes[front];
}

/// One active element, made ready for all slices of a slab.
struct Ready {
    const SliceElement* element;
    int layerBegin, layerEnd;
    int triangles;
    PixelRect rect;
    int corners;  ///< 0: a rectangle
    std::array<double, 2> corner[4];
};

Ready makeReady(const SlabInput& input, const SliceElement& e) {
    const SliceAxes& axes = input.axes;
    Ready ready{};
    ready.element = &e;
    ready.layerBegin = std::max(input.layerBegin, int(e.low[axes.l]));
    ready.layerEnd = std::min(input.layerEnd, int(e.high[axes.l]) + 1);
    ready.rect = {e.low[axes.s], e.low[axes.t], e.high[axes.s], e.high[axes.t]};
    double extent = 0;
    for (const int axis : {axes.s, axes.t}) {
        const auto [low, high] =
            std::minmax({e.node[0][axis], e.node[1][axis], e.node[2][axis], e.node[3][axis]});
        extent = std::max(extent, double(high) - double(low));
    }
    const Silhouette& silhouette = silhouetteOf(e, axes);
    ready.triangles = std::max(1, silhouette.corners - 2);
    if (e.isSmall || extent > kLargestPolygon) return ready;
    ready.corners = silhouette.corners;
    for (int k = 0; k < silhouette.corners; ++k) {
        const float* node = e.node[silhouette.node[k]];
        ready.corner[k] = {double(node[axes.s]) + e.first[axes.s] + 0.5,
                           double(node[axes.t]) + e.first[axes.t] + 0.5};
    }
    return ready;
}

}  // namespace

void SilhouetteGenerator::emit(const SlabInput& input, SliceBatch& batch) const {
    static thread_local std::vector<Ready> active;
    active.clear();
    for (const std::int32_t slot : input.active)
        active.push_back(makeReady(input, input.elements[std::size_t(slot)]));
    for (int layer = input.layerBegin; layer < input.layerEnd; ++layer)
        for (const Ready& ready : active) {
            if (layer < ready.layerBegin || layer >= ready.layerEnd) continue;
            const SliceElement& e = *ready.element;
            PrimitiveList& list = e.grade == ShapeGrade::easy ? batch.easy : batch.thin;
            ++batch.pairs;
            batch.polygons += e.isSmall ? 1 : ready.triangles;
            if (ready.corners > 0 && emitGrown(std::span(ready.corner, std::size_t(ready.corners)), kGrowth,
                                               layer, e.record, list))
                continue;
            emitRect(ready.rect, layer, e, list);
        }
}

void SilhouetteGenerator::emitPublished(const SlabInput& input, SliceBatch& batch) const {
    PublishedList& list = batch.published;
    for (int layer = input.layerBegin; layer < input.layerEnd; ++layer)
        for (const std::int32_t slot : input.active) {
            const SliceElement& e = input.elements[std::size_t(slot)];
            if (layer < e.low[input.axes.l] || layer > e.high[input.axes.l]) continue;
            const Silhouette& silhouette = silhouetteOf(e, input.axes);
            ++batch.pairs;
            if (silhouette.corners == 0) continue;
            batch.polygons += silhouette.corners - 2;
            const auto first = std::uint32_t(list.silhouettes.size());
            for (int k = 0; k < silhouette.corners; ++k)
                list.silhouettes.push_back(
                    {e.record, std::uint16_t(layer), std::uint16_t(silhouette.node[k])});
            for (std::uint32_t k = 2; k < std::uint32_t(silhouette.corners); ++k)
                list.indices.insert(list.indices.end(), {first, first + k - 1, first + k});
        }
}

const ShaderText& SilhouetteGenerator::shader() const {
    return shaders::slicing::kSilhouettes;
}

}  // namespace tessera
