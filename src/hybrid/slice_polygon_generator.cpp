#include "hybrid/slice_polygon_generator.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "hybrid/shaders.h"

namespace tessera {

namespace {

/// A pixel centre this close to a polygon's bounding rectangle may be covered by it.
constexpr double kMargin = 0x1p-8;
/// Polygons that would have to grow by more make way for rectangles.
constexpr double kMostError = 0x1p-6;
/// Rounding of node places in float, for each voxel of size, with room for that of the cut itself.
constexpr double kPlaceRounding = 0x1p-21;

/// Rectangles of more pixels are taken as they are.
constexpr int kMostTightened = 16;

/// The edges that a plane cuts, for each set of nodes on its upper side (bit k: node k), in order around the
/// polygon. Edges are pairs of nodes, the lower first.
struct Cut {
    int corners;
    int edge[4][2];
};
constexpr Cut kCuts[16] = {{0, {}},
                           {3, {{0, 1}, {0, 2}, {0, 3}}},
                           {3, {{0, 1}, {1, 2}, {1, 3}}},
                           {4, {{0, 2}, {0, 3}, {1, 3}, {1, 2}}},
                           {3, {{0, 2}, {1, 2}, {2, 3}}},
                           {4, {{0, 1}, {0, 3}, {2, 3}, {1, 2}}},
                           {4, {{0, 1}, {1, 3}, {2, 3}, {0, 2}}},
                           {3, {{0, 3}, {1, 3}, {2, 3}}},
                           {3, {{0, 3}, {1, 3}, {2, 3}}},
                           {4, {{0, 1}, {1, 3}, {2, 3}, {0, 2}}},
                           {4, {{0, 1}, {0, 3}, {2, 3}, {1, 2}}},
                           {3, {{0, 2}, {1, 2}, {2, 3}}},
                           {4, {{0, 2}, {0, 3}, {1, 3}, {1, 2}}},
                           {3, {{0, 1}, {1, 2}, {1, 3}}},
                           {3, {{0, 1}, {0, 2}, {0, 3}}},
                           {0, {}}};

struct SlicePolygon {
    int corners = 0;
    std::array<double, 2> corner[4];  ///< relative to the element's first voxel
    double error = 0;                 ///< how far from it an accepted point may lie
};

/// @param height of the slice over the element's first voxel.
SlicePolygon cutElement(const SliceElement& e, const SliceAxes& axes, double height, double extent) {
    // Accepted points lie in an element whose nodes are off by this.
    const double off = kPlaceRounding * (extent + 1) + double(e.margin);
    double above[4];
    unsigned set = 0;
    for (unsigned k = 0; k < 4; ++k) {
        above[k] = double(e.node[k][axes.l]) - height;
        if (above[k] >= 0) set |= 1u << k;
    }
    const Cut& cut = kCuts[set];
    SlicePolygon polygon;
    polygon.corners = cut.corners;
    for (int c = 0; c < cut.corners; ++c) {
        const int a = cut.edge[c][0], b = cut.edge[c][1];
        const double rise = above[a] - above[b];
        const double share = std::clamp(above[a] / rise, 0.0, 1.0);
        const double ds = double(e.node[b][axes.s]) - double(e.node[a][axes.s]);
        const double dt = double(e.node[b][axes.t]) - double(e.node[a][axes.t]);
        polygon.corner[c] = {double(e.node[a][axes.s]) + share * ds, double(e.node[a][axes.t]) + share * dt};
        const double run = std::max(std::fabs(ds), std::fabs(dt));
        polygon.error = std::max(polygon.error, 2 * std::min(run, off * (1 + run / std::fabs(rise))));
    }
    return polygon;
}

double extentOf(const SliceElement& e) {
    double extent = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const auto [low, high] =
            std::minmax({e.node[0][axis], e.node[1][axis], e.node[2][axis], e.node[3][axis]});
        extent = std::max(extent, double(high) - double(low));
    }
    return extent;
}

/// Shrinks a rectangle of few pixels to those that no edge's direction tells apart from the polygon; false
/// when there are none. @param from the element's first voxel, as a pixel.
bool tighten(const SlicePolygon& polygon, double margin, const int (&from)[2], PixelRect& rect) {
    const int width = rect.s1 - rect.s0 + 1, height = rect.t1 - rect.t0 + 1;
    if (width * height > kMostTightened) return true;
    double normal[4][2], least[4], most[4];
    for (int c = 0; c < polygon.corners; ++c) {
        const auto& a = polygon.corner[c];
        const auto& b = polygon.corner[(c + 1) % polygon.corners];
        normal[c][0] = a[1] - b[1];
        normal[c][1] = b[0] - a[0];
        least[c] = INFINITY;
        most[c] = -INFINITY;
        for (int k = 0; k < polygon.corners; ++k) {
            const double at = normal[c][0] * polygon.corner[k][0] + normal[c][1] * polygon.corner[k][1];
            least[c] = std::min(least[c], at);
            most[c] = std::max(most[c], at);
        }
        // At least the margin times the normal's length.
        const double room = margin * (std::fabs(normal[c][0]) + std::fabs(normal[c][1]));
        least[c] -= room;
        most[c] += room;
    }
    PixelRect kept{rect.s1 + 1, rect.t1 + 1, rect.s0 - 1, rect.t0 - 1};
    for (int t = rect.t0; t <= rect.t1; ++t)
        for (int s = rect.s0; s <= rect.s1; ++s) {
            bool isOutside = false;
            for (int c = 0; c < polygon.corners; ++c) {
                const double at = normal[c][0] * (s - from[0]) + normal[c][1] * (t - from[1]);
                isOutside |= at < least[c] || at > most[c];
            }
            if (isOutside) continue;
            kept = {std::min(kept.s0, s), std::min(kept.t0, t), std::max(kept.s1, s), t};
        }
    rect = kept;
    return rect.s0 <= rect.s1;
}

void emitSlice(const SlabInput& input, const SliceElement& e, int layer, double extent, SliceBatch& batch) {
    const SliceAxes& axes = input.axes;
    PrimitiveList& list = e.grade == ShapeGrade::easy ? batch.easy : batch.thin;
    SlicePolygon polygon = cutElement(e, axes, double(layer - e.first[axes.l]), extent);
    PixelRect rect{e.low[axes.s], e.low[axes.t], e.high[axes.s], e.high[axes.t]};
    // A plane that only touches the element, within rounding, has no polygon: its whole rectangle is drawn.
    if (polygon.corners > 0) {
        double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
        for (int c = 0; c < polygon.corners; ++c)
            for (std::size_t a = 0; a < 2; ++a) {
                low[a] = std::min(low[a], polygon.corner[c][a]);
                high[a] = std::max(high[a], polygon.corner[c][a]);
            }
        const double margin = kMargin + polygon.error;
        const int s0 = int(std::ceil(low[0] - margin)), s1 = int(std::floor(high[0] + margin));
        const int t0 = int(std::ceil(low[1] - margin)), t1 = int(std::floor(high[1] + margin));
        rect = {std::max(rect.s0, s0 + e.first[axes.s]), std::max(rect.t0, t0 + e.first[axes.t]),
                std::min(rect.s1, s1 + e.first[axes.s]), std::min(rect.t1, t1 + e.first[axes.t])};
        if (rect.s0 > rect.s1 || rect.t0 > rect.t1) return;
        if (e.isSmall && !tighten(polygon, margin, {e.first[axes.s], e.first[axes.t]}, rect)) return;
    }
    ++batch.polygons;
    if (!e.isSmall && polygon.corners > 0 && polygon.error < kMostError && extent <= kLargestPolygon) {
        for (int c = 0; c < polygon.corners; ++c) {
            polygon.corner[c][0] += e.first[axes.s] + 0.5;
            polygon.corner[c][1] += e.first[axes.t] + 0.5;
        }
        const double growth = kGrowth + 1.5 * polygon.error;
        if (emitGrown(std::span(polygon.corner, std::size_t(polygon.corners)), growth, layer, e.record, list))
            return;
    }
    emitRect(rect, layer, e, list);
}

}  // namespace

void SlicePolygonGenerator::emit(const SlabInput& input, SliceBatch& batch) const {
    const int axis = input.axes.l;
    static thread_local std::vector<double> extents;
    extents.clear();
    for (const std::int32_t slot : input.active)
        extents.push_back(extentOf(input.elements[std::size_t(slot)]));
    for (int layer = input.layerBegin; layer < input.layerEnd; ++layer)
        for (std::size_t i = 0; i < extents.size(); ++i) {
            const SliceElement& e = input.elements[std::size_t(input.active[i])];
            if (layer < e.low[axis] || layer > e.high[axis]) continue;
            ++batch.pairs;
            emitSlice(input, e, layer, extents[i], batch);
        }
}

namespace {

/// The cut of one edge, computed from the same end by all elements that have the edge, so that neighbours
/// emit the same bits and the fill rule neither drops nor doubles a pixel between them.
GouraudCorner cutEdge(const SlabInput& input, std::uint32_t record, int a, int b, int layer) {
    const PublishedGeometry& geometry = input.published[record];
    const auto key = [&](int k) {
        return std::tuple(geometry.node[k][2], geometry.node[k][0], geometry.node[k][1]);
    };
    if (key(b) < key(a)) std::swap(a, b);
    const float* from = geometry.node[a];
    const float* to = geometry.node[b];
    const double rise = double(to[2]) - double(from[2]);
    const double share = rise > 0 ? std::clamp((layer - double(from[2])) / rise, 0.0, 1.0) : 0.0;
    GouraudCorner corner{float(double(from[0]) + share * (double(to[0]) - double(from[0]))),
                         float(double(from[1]) + share * (double(to[1]) - double(from[1]))),
                         std::uint32_t(layer),
                         {0, 0, 0, 0}};
    const std::size_t channels = std::size_t(input.channels);
    for (std::size_t c = 0; c < channels; ++c) {
        const float* codes = input.nodeCodes[record * channels + c].codes;
        corner.codes[c] = float(double(codes[a]) + share * (double(codes[b]) - double(codes[a])));
    }
    return corner;
}

}  // namespace

void SlicePolygonGenerator::emitPublished(const SlabInput& input, SliceBatch& batch) const {
    PublishedList& list = batch.published;
    for (int layer = input.layerBegin; layer < input.layerEnd; ++layer)
        for (const std::int32_t slot : input.active) {
            const SliceElement& e = input.elements[std::size_t(slot)];
            if (layer < e.low[input.axes.l] || layer > e.high[input.axes.l]) continue;
            ++batch.pairs;
            unsigned set = 0;
            for (unsigned k = 0; k < 4; ++k)
                if (input.published[e.record].node[k][2] >= float(layer)) set |= 1u << k;
            const Cut& cut = kCuts[set];
            if (cut.corners == 0) continue;
            ++batch.polygons;
            const auto first = std::uint32_t(list.polygons.size());
            for (int c = 0; c < cut.corners; ++c)
                list.polygons.push_back(cutEdge(input, e.record, cut.edge[c][0], cut.edge[c][1], layer));
            for (std::uint32_t k = 2; k < std::uint32_t(cut.corners); ++k)
                list.indices.insert(list.indices.end(), {first, first + k - 1, first + k});
        }
}

const ShaderText& SlicePolygonGenerator::shader() const {
    return shaders::hybrid::kSlicePolygons;
}

}  // namespace tessera
