#include "surface/unfit_triangles.h"

#include <algorithm>
#include <array>

#include "base/parallel.h"
#include "surface/exact_normal.h"

namespace tessera {

std::vector<std::uint8_t> trianglesWithCornerTwice(const Surface& surface) {
    std::vector<std::uint8_t> marked;
    marked.reserve(surface.triangles.size());
    for (const auto& t : surface.triangles) marked.push_back(t[0] == t[1] || t[1] == t[2] || t[2] == t[0]);
    return marked;
}

std::vector<std::uint8_t> flatTriangles(const Surface& surface, const Execution& execution) {
    const auto count = std::int64_t(surface.triangles.size());
    std::vector<std::uint8_t> flat(surface.triangles.size());
    parallelForChunks(execution, count, 1 << 12, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t t = begin; t < end; ++t) flat[std::size_t(t)] = mainAxis(cornersOf(surface, t)) < 0;
    });
    return flat;
}

std::vector<std::uint8_t> laterDuplicates(const Surface& surface, std::span<const std::uint8_t> leftOut) {
    struct Keyed {
        std::array<std::int32_t, 3> points;
        std::int32_t triangle;

        bool operator<(const Keyed& other) const {
            return points != other.points ? points < other.points : triangle < other.triangle;
        }
    };
    std::vector<Keyed> keyed;
    keyed.reserve(surface.triangles.size());
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
        if (leftOut[t]) continue;
        keyed.push_back({surface.triangles[t], std::int32_t(t)});
        std::sort(keyed.back().points.begin(), keyed.back().points.end());
    }
    std::sort(keyed.begin(), keyed.end());
    std::vector<std::uint8_t> later(surface.triangles.size(), 0);
    for (std::size_t i = 1; i < keyed.size(); ++i)
        if (keyed[i].points == keyed[i - 1].points) later[std::size_t(keyed[i].triangle)] = 1;
    return later;
}

}  // namespace tessera
