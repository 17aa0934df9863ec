#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "surface/surface.h"

namespace tessera {

/// An edge of a triangle.
struct EdgeUse {
    /// Its points, the smaller number first.
    std::int32_t low, high;
    std::int32_t triangle;
    /// From corner `side` of the triangle to the next one.
    std::uint8_t side;
    /// Whether it runs from low to high there.
    bool rises;

    bool sameEdge(const EdgeUse& other) const { return low == other.low && high == other.high; }
};

/// The edges of all triangles, by their points and then by triangle. Throws InternalError from 2^30 triangles
/// on.
/// @param leftOut one entry a triangle, not 0: it counts as absent; it must where it has a corner twice.
std::vector<EdgeUse> edgeUses(const Surface& surface, std::span<const std::uint8_t> leftOut);

/// Calls visit(std::span<const EdgeUse>) for every edge with its uses.
template <class Visit>
void forEachEdge(std::span<const EdgeUse> uses, Visit&& visit) {
    for (std::size_t begin = 0, end; begin < uses.size(); begin = end) {
        end = begin + 1;
        while (end < uses.size() && uses[end].sameEdge(uses[begin])) ++end;
        visit(uses.subspan(begin, end - begin));
    }
}

/// Triangles that are connected over edges of exactly two triangles.
struct SurfacePart {
    std::int64_t firstTriangle = 0, triangles = 0;
    /// Each of its edges has exactly two triangles.
    bool closed = true;
    /// Turning triangles can make neighbours agree.
    bool orientable = true;
};

struct SurfaceParts {
    /// By their first triangles.
    std::vector<SurfacePart> parts;
    /// Of every triangle; -1: left out.
    std::vector<std::int32_t> partOf;
    /// One entry a triangle, 1: it runs the other way round than most of its part, or than its first where
    /// there are as many of both. Says little where a part isn't orientable.
    std::vector<std::uint8_t> turned;
};

/// @param uses edgeUses(surface, leftOut).
SurfaceParts findParts(const Surface& surface, std::span<const EdgeUse> uses,
                       std::span<const std::uint8_t> leftOut);

}  // namespace tessera
