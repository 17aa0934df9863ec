#include "brick/overlap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "reference/random.h"

namespace tessera {
namespace {

using Nodes = std::array<Vec3d, 4>;
constexpr int kShapes = 5;

/// A tetrahedron, a flat one, nodes in a line, a needle, one that holds the box many times.
Nodes drawn(Random& random, int shape) {
    Nodes nodes;
    const Vec3d from = 20.0 * random.offset(), along = 30.0 * random.offset(),
                beside = 30.0 * random.offset();
    for (Vec3d& node : nodes) {
        const double a = random.unit(), b = random.unit();
        const Vec3d off = random.offset();
        if (shape == 0) node = from + 20.0 * off;
        if (shape == 1) node = from + a * along + b * beside;
        if (shape == 2) node = from + a * along;
        if (shape == 3) node = from + a * along + 1e-11 * off;
        if (shape == 4) node = from + 200.0 * off;
    }
    return nodes;
}

TEST(ElementOverlap, WhatHasAPointInTheBoxTouchesIt) {
    Random random(1);
    for (int n = 0; n < 20000; ++n) {
        const Nodes nodes = drawn(random, n % kShapes);
        Vec3d inside(0);
        double sum = 0;
        for (const Vec3d& node : nodes) {
            const double weight = random.unit();
            inside += weight * node;
            sum += weight;
        }
        inside /= sum;
        // The place lies anywhere in the box, but for what rounds.
        const Vec3d low = inside - 16.0 * (0.001 + 0.998 * random.place());
        EXPECT_TRUE(ElementOverlap(nodes).touches({low, low + 16.0})) << n;
    }
}

TEST(ElementOverlap, WhatAPlaneKeepsApartDoesNotTouch) {
    Random random(2);
    const Box3d box{Vec3d(-8), Vec3d(8)};
    for (int n = 0; n < 40000; ++n) {
        Nodes nodes = drawn(random, n % kShapes);
        const Vec3d normal = glm::normalize(random.offset());
        double lowest = std::numeric_limits<double>::infinity();
        for (const Vec3d& node : nodes) lowest = std::min(lowest, glm::dot(normal, node));
        const Vec3d shift = normal * (glm::dot(glm::abs(normal), box.max) + 1e-6 - lowest);
        for (Vec3d& node : nodes) node += shift;
        EXPECT_FALSE(ElementOverlap(nodes).touches(box)) << n;
    }
}

TEST(ElementOverlap, HoldsWhatLiesWellInsideAndNothingOutside) {
    Random random(3);
    int held = 0, asked = 0;
    for (int n = 0; n < 40000; ++n) {
        const Nodes nodes = drawn(random, n % kShapes);
        const ElementOverlap element(nodes);
        // Weights of nodes, of which one may be below 0 by a little.
        Vec3d point(0);
        double sum = 0, least = 1;
        for (const Vec3d& node : nodes) {
            const double weight = random.unit() - 0.1;
            point += weight * node;
            sum += weight;
            least = std::min(least, weight);
        }
        if (sum < 0.5) continue;
        point /= sum;
        const bool isSolid = n % kShapes == 0 || n % kShapes == 4;
        if (!isSolid || least < 0) {
            EXPECT_FALSE(element.holds(point)) << n;
            continue;
        }
        if (least < 0.01) continue;
        ++asked;
        held += element.holds(point);
    }
    EXPECT_GT(asked, 5000);
    EXPECT_GT(held, asked * 99 / 100);
    const ElementOverlap unit({Vec3d{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
    EXPECT_TRUE(unit.holds({0.25, 0.25, 0.25}));
    EXPECT_FALSE(unit.holds({0.25, 0.25, 0}));  // on a face nothing is sure
    EXPECT_FALSE(unit.holds({0.25, 0.25, -1e-12}));
    EXPECT_FALSE(unit.holds(Vec3d(std::numeric_limits<double>::quiet_NaN())));
    for (const double scale : {1e-110, 1e-95, 1e95, 1e105}) {
        Nodes nodes{Vec3d{0.1, 0.2, 0.3}, {1, 0, 0.1}, {0.3, 1, 0}, {0.2, 0.1, 1}};
        for (Vec3d& node : nodes) node *= scale;
        for (int n = 0; n < 2000; ++n) {
            const double a = random.unit(), b = random.unit() * (1 - a), out = 1e-7 * random.unit();
            const Vec3d beyond = a * nodes[0] + b * nodes[1] + (1 - a - b + out) * nodes[2] - out * nodes[3];
            EXPECT_FALSE(ElementOverlap(nodes).holds(beyond)) << scale;
        }
    }
}

TEST(ElementOverlap, NormalsOfNodesInALineDecideNothing) {
    // 13 voxels apart, in the box's bounds; cross products of the edges are rounding alone.
    const Nodes nodes{{{61.272329117518055, 12.633448828977588, 29.567121704755372},
                       {85.77556203088272, 32.989350888266515, 46.51879157832667},
                       {140.58074376164524, 78.51840069150501, 84.43376187411349},
                       {155.81626420983406, 91.17521063826395, 94.973902185512}}};
    EXPECT_FALSE(ElementOverlap(nodes).touches({{143.9921875, 47.9921875, 63.9921875}, {160, 64, 80}}));
}

}  // namespace
}  // namespace tessera
