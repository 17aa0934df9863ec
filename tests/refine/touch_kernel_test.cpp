// Pairs of elements and boxes in vectors against single ones, on every instruction set there is.
#include "refine/touch_kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "every_target.h"

namespace tessera {
namespace {

TEST(TouchKernel, SaysOfPairsWhatIsSaidOfEach) {
    std::mt19937_64 random(3);
    const auto any = [&](double low, double high) {
        return std::uniform_real_distribution(low, high)(random);
    };
    const Box3d box{Vec3d(16 - kBrickSlackVoxels), Vec3d(32)};
    std::vector<ElementOverlap> elements;
    int touching = 0, apart = 0;
    while (elements.size() < 4000) {
        // Slivers, flat ones, and nodes on the box's planes, beside elements of any shape and size.
        const double kind = any(0, 1), size = std::exp2(any(-6, 5));
        const Vec3d centre(any(8, 40), any(8, 40), any(8, 40));
        std::array<Vec3d, 4> nodes;
        for (Vec3d& node : nodes) node = centre + Vec3d(any(-1, 1), any(-1, 1), any(-1, 1)) * size;
        if (kind < 0.1) nodes[3] = nodes[2];
        if (kind < 0.3) nodes[0] = glm::round(nodes[0] / 16.0) * 16.0;
        if (kind > 0.9) nodes[1] = nodes[0] + Vec3d(0, 16, 16);
        const ElementOverlap element(nodes);
        if (!element.boundsTouch(box)) continue;
        elements.push_back(element);
        ++(element.touches(box) ? touching : apart);
    }
    ASSERT_GT(touching, 300);
    ASSERT_GT(apart, 300);
    const auto batch = std::make_unique<TouchBatch>();
    for (const std::size_t most : {std::size_t(1), std::size_t(5), kTouchLanes})
        onEveryTarget([&] {
            for (std::size_t first = 0; first < elements.size(); first += batch->count) {
                batch->count = 0;
                while (batch->count < most && first + batch->count < elements.size())
                    batch->add(elements[first + batch->count].nodes(), box);
                const std::uint64_t found = tessera::touching(*batch);
                for (std::size_t i = 0; i < kTouchLanes; ++i)
                    EXPECT_EQ(found >> i & 1, i < batch->count && elements[first + i].touches(box));
            }
        });
}

}  // namespace
}  // namespace tessera
