#include "surface/surface_edges.h"

#include <algorithm>
#include <array>

#include "base/check.h"

namespace tessera {

namespace {

/// What lies over the three edges of a triangle: 2 * the other triangle of an edge of exactly two + (1 where
/// both run the same way along it).
using Neighbours = std::array<std::int32_t, 3>;
constexpr std::int32_t kNone = -1;

std::vector<Neighbours> findNeighbours(std::size_t triangles, std::span<const EdgeUse> uses) {
    std::vector<Neighbours> neighbours(triangles, Neighbours{kNone, kNone, kNone});
    forEachEdge(uses, [&](std::span<const EdgeUse> users) {
        if (users.size() != 2) return;
        for (std::size_t i = 0; i < 2; ++i)
            neighbours[std::size_t(users[i].triangle)][users[i].side] =
                2 * users[1 - i].triangle + (users[0].rises == users[1].rises);
    });
    return neighbours;
}

/// Goes through one part from its first triangle on, breadth first.
SurfacePart walkPart(std::int32_t first, const std::vector<Neighbours>& neighbours, SurfaceParts& found) {
    SurfacePart part;
    part.firstTriangle = first;
    const auto number = std::int32_t(found.parts.size());
    std::vector<std::int32_t> reached{first};
    found.partOf[std::size_t(first)] = number;
    for (std::size_t next = 0; next < reached.size(); ++next) {
        const auto triangle = std::size_t(reached[next]);
        for (const std::int32_t neighbour : neighbours[triangle]) {
            if (neighbour == kNone) {
                part.closed = false;
                continue;
            }
            const auto other = std::size_t(neighbour / 2);
            const auto turned = std::uint8_t(found.turned[triangle] ^ (neighbour & 1));
            if (found.partOf[other] == kNone) {
                found.partOf[other] = number;
                found.turned[other] = turned;
                reached.push_back(std::int32_t(other));
            } else if (found.turned[other] != turned) {
                part.orientable = false;
            }
        }
    }
    part.triangles = std::int64_t(reached.size());
    std::int64_t turned = 0;
    for (const std::int32_t triangle : reached) turned += found.turned[std::size_t(triangle)];
    if (2 * turned > part.triangles)
        for (const std::int32_t triangle : reached) found.turned[std::size_t(triangle)] ^= 1;
    return part;
}

}  // namespace

std::vector<EdgeUse> edgeUses(const Surface& surface, std::span<const std::uint8_t> leftOut) {
    TESSERA_CHECK(leftOut.size() == surface.triangles.size(), "one flag a triangle");
    TESSERA_CHECK(surface.triangles.size() < (std::size_t(1) << 30), "fewer than 2^30 triangles");
    const auto forEachUse = [&](const auto& visit) {
        for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
            if (leftOut[t]) continue;
            for (std::size_t side = 0; side < 3; ++side) {
                const std::int32_t from = surface.triangles[t][side];
                const std::int32_t to = surface.triangles[t][(side + 1) % 3];
                visit(EdgeUse{std::min(from, to), std::max(from, to), std::int32_t(t), std::uint8_t(side),
                              from < to});
            }
        }
    };
    // Counted to the smaller point, where few are left to be sorted.
    std::vector<std::int64_t> begin(surface.points.size() + 1, 0);
    forEachUse([&](const EdgeUse& use) { ++begin[std::size_t(use.low) + 1]; });
    for (std::size_t p = 0; p < surface.points.size(); ++p) begin[p + 1] += begin[p];
    std::vector<EdgeUse> uses(std::size_t(begin.back()));
    std::vector<std::int64_t> cursor = begin;
    forEachUse([&](const EdgeUse& use) { uses[std::size_t(cursor[std::size_t(use.low)]++)] = use; });
    for (std::size_t p = 0; p < surface.points.size(); ++p)
        std::sort(uses.begin() + begin[p], uses.begin() + begin[p + 1],
                  [](const EdgeUse& a, const EdgeUse& b) {
                      return a.high != b.high ? a.high < b.high : a.triangle < b.triangle;
                  });
    return uses;
}

SurfaceParts findParts(const Surface& surface, std::span<const EdgeUse> uses,
                       std::span<const std::uint8_t> leftOut) {
    const std::size_t triangles = surface.triangles.size();
    const std::vector<Neighbours> neighbours = findNeighbours(triangles, uses);
    SurfaceParts found;
    found.partOf.assign(triangles, kNone);
    found.turned.assign(triangles, 0);
    for (std::size_t t = 0; t < triangles; ++t)
        if (!leftOut[t] && found.partOf[t] == kNone)
            found.parts.push_back(walkPart(std::int32_t(t), neighbours, found));
    return found;
}

}  // namespace tessera
