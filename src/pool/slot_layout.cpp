#include "pool/slot_layout.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "tessera/error.h"

namespace tessera {

namespace {

// The box of at most `most` slots that holds the most, of edges up to `mostEdge`.
Vec3i largestBox(std::int64_t most, std::int64_t mostEdge) {
    Vec3i best(0);
    std::int64_t bestCount = 0;
    const auto cube = std::int64_t(std::cbrt(double(most)));
    const std::int64_t first = std::min(mostEdge, std::max<std::int64_t>(1, cube / 2));
    const std::int64_t last = std::min(mostEdge, 2 * cube + 1);
    for (std::int64_t x = first; x <= last; ++x)
        for (std::int64_t y = x; y <= last && x * y <= most; ++y) {
            const std::int64_t z = std::min(mostEdge, most / (x * y));
            if (x * y * z > bestCount) bestCount = x * y * z, best = Vec3i(x, y, z);
        }
    return best;
}

}  // namespace

SlotLayout chooseSlotLayout(int edge, std::int64_t texelBytes, std::int64_t largestTexelBytes,
                            std::int64_t budgetBytes, const AtlasLimits& limits) {
    const std::int64_t slotTexels = std::int64_t(edge) * edge * edge;
    const std::int64_t wanted = budgetBytes / (slotTexels * texelBytes);
    const std::int64_t mostEdge = limits.texels / edge;
    const std::int64_t mostInAtlas =
        std::min(limits.bytes / (slotTexels * largestTexelBytes), mostEdge * mostEdge * mostEdge);
    if (wanted < 1 || mostInAtlas < 1)
        throw InputError("a brick pool of " + std::to_string(budgetBytes) + " bytes, in textures of " +
                         std::to_string(limits.texels) + " texels an edge and " +
                         std::to_string(limits.bytes) + " bytes, holds no brick: one takes " +
                         std::to_string(edge) + "^3 texels of " + std::to_string(texelBytes) + " bytes");
    SlotLayout layout;
    layout.edge = edge;
    const std::int64_t atlases =
        std::min<std::int64_t>(limits.atlases, (wanted + mostInAtlas - 1) / mostInAtlas);
    layout.atlases = int(atlases);
    layout.slots = largestBox(std::min(wanted / atlases, mostInAtlas), mostEdge);
    return layout;
}

}  // namespace tessera
