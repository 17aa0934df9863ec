#include "refine/wishes.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// A move by a smaller share of the radius, or by fewer finest spacings, whichever is more, is jitter.
constexpr double kJitterShare = 1.0 / 16;
constexpr double kJitterSpacings = 2;

bool isFinite(const Vec3d& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

double distance(const Box3d& a, const Box3d& b) {
    return glm::length(glm::max(glm::max(a.min - b.max, b.min - a.max), Vec3d(0)));
}

double distanceBeyond(const Focus& focus, const Box3d& box) {
    return std::max(0.0, distance(focus.boxWorld, box) - focus.roundingWorld);
}

bool reaches(const Focus& focus, const Box3d& box) {
    return std::none_of(focus.within.begin(), focus.within.end(),
                        [&](const HalfSpace& half) { return isOutside(box, half); });
}

}  // namespace

bool isOutside(const Box3d& box, const HalfSpace& half) {
    const Vec3d& n = half.normalWorld;
    const Vec3d farthest(n.x > 0 ? box.max.x : box.min.x, n.y > 0 ? box.max.y : box.min.y,
                         n.z > 0 ? box.max.z : box.min.z);
    return glm::dot(n, farthest) < half.offsetWorld;
}

double wishedByFocus(std::span<const Focus> focus, double finestSpacingWorld, const Box3d& boxWorld) {
    double wished = kNoWish;
    for (const Focus& one : focus) {
        if (!reaches(one, boxWorld)) continue;
        const double far = distanceBeyond(one, boxWorld) / one.radiusWorld;
        wished = std::min(wished, finestSpacingWorld * std::max(1.0, far));
    }
    return wished;
}

bool holdsFocus(std::span<const Focus> focus, const Box3d& boxWorld) {
    return std::any_of(focus.begin(), focus.end(), [&](const Focus& one) {
        return reaches(one, boxWorld) && distance(one.boxWorld, boxWorld) == 0;
    });
}

ChildWishes wishesOfChildren(std::span<const Focus> focus, double finestSpacingWorld,
                             const ChildBoxes& boxesWorld, double enoughWorld) {
    ChildWishes wishes;
    wishes.wishedWorld.fill(kNoWish);
    wishes.holdsFocus.fill(false);
    for (const Focus& one : focus) {
        double square[3][2];  // of the distance on an axis
        for (int half = 0; half < 2; ++half) {
            const Box3d& box = boxesWorld.halves[half];
            const Vec3d apart =
                glm::max(glm::max(one.boxWorld.min - box.max, box.min - one.boxWorld.max), Vec3d(0));
            for (int a = 0; a < 3; ++a) square[a][half] = apart[a] * apart[a];
        }
        // Most are so far away that their wish doesn't count, which the square of the distance shows.
        const double farthest =
            enoughWorld / finestSpacingWorld * one.radiusWorld * (1 + 1e-9) + one.roundingWorld;
        for (unsigned c = 0; c < 8; ++c) {
            const double apartSquare = square[0][c & 1] + square[1][c >> 1 & 1] + square[2][c >> 2];
            if (apartSquare > farthest * farthest) continue;
            if (!one.within.empty() && !reaches(one, boxesWorld.box(c))) continue;
            const double far = std::max(0.0, std::sqrt(apartSquare) - one.roundingWorld) / one.radiusWorld;
            wishes.wishedWorld[c] = std::min(wishes.wishedWorld[c], finestSpacingWorld * std::max(1.0, far));
            wishes.holdsFocus[c] = wishes.holdsFocus[c] || apartSquare == 0;
        }
    }
    return wishes;
}

void checkFocus(std::span<const Focus> focus) {
    for (const Focus& one : focus) {
        if (!isFinite(one.boxWorld.min) || !isFinite(one.boxWorld.max) || one.boxWorld.empty())
            throw InputError("a focus must be a place with finite coordinates, or a box with min below max");
        if (!std::isfinite(one.radiusWorld) || !(one.radiusWorld > 0))
            throw InputError("the radius of a focus must be positive, not " +
                             shortNumber(one.radiusWorld, 6));
        if (!std::isfinite(one.roundingWorld) || one.roundingWorld < 0)
            throw InputError("the ball around a focus can't have a radius of " +
                             shortNumber(one.roundingWorld, 6));
    }
}

bool isJitter(std::span<const Focus> a, std::span<const Focus> b, double finestSpacingWorld) {
    const auto isNear = [&](const Focus& x, const Focus& y) {
        const double most = std::max(kJitterShare * std::min(x.radiusWorld, y.radiusWorld),
                                     kJitterSpacings * finestSpacingWorld);
        const auto moved = [&](double distanceWorld) { return !(std::abs(distanceWorld) < most); };
        if (moved(glm::distance(x.boxWorld.min, y.boxWorld.min)) ||
            moved(glm::distance(x.boxWorld.max, y.boxWorld.max)) ||
            moved(x.roundingWorld - y.roundingWorld) || x.within.size() != y.within.size() ||
            std::abs(x.radiusWorld - y.radiusWorld) >= kJitterShare * std::min(x.radiusWorld, y.radiusWorld))
            return false;
        for (std::size_t i = 0; i < x.within.size(); ++i)
            if (glm::distance(x.within[i].normalWorld, y.within[i].normalWorld) >= kJitterShare / 4 ||
                moved(x.within[i].offsetWorld - y.within[i].offsetWorld))
                return false;
        return true;
    };
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), isNear);
}

}  // namespace tessera
