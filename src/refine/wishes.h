#pragma once

#include <array>
#include <limits>
#include <span>
#include <vector>

#include "tessera/focus.h"
#include "tessera/vec.h"

namespace tessera {

inline constexpr double kNoWish = std::numeric_limits<double>::infinity();

/// The finest spacing that focuses wish for somewhere in a closed box, world units; kNoWish without any.
double wishedByFocus(std::span<const Focus> focus, double finestSpacingWorld, const Box3d& boxWorld);

/// Whether nothing of a closed box lies in a half-space.
bool isOutside(const Box3d& box, const HalfSpace& half);

/// Whether a place where a focus stands lies in the box.
bool holdsFocus(std::span<const Focus> focus, const Box3d& boxWorld);

/// The boxes of the eight children of a brick: on each axis one of two, by the bit of childNumber().
struct ChildBoxes {
    Box3d halves[2];
    Box3d box(unsigned child) const {
        Box3d result;
        for (int a = 0; a < 3; ++a) {
            const Box3d& half = halves[child >> a & 1];
            result.min[a] = half.min[a];
            result.max[a] = half.max[a];
        }
        return result;
    }
};

/// wishedByFocus() and holdsFocus() of eight children at once, for bricks that ask for `enoughWorld`: wishes
/// for coarser spacings may be given as kNoWish.
struct ChildWishes {
    std::array<double, 8> wishedWorld;
    std::array<bool, 8> holdsFocus;
};
ChildWishes wishesOfChildren(std::span<const Focus> focus, double finestSpacingWorld,
                             const ChildBoxes& boxesWorld, double enoughWorld);

/// Whether bricks wish to be split: whether their spacing is coarser than the one wished for, and not by
/// rounding alone.
inline bool isTooCoarse(double spacingWorld, double wishedWorld) {
    return spacingWorld > wishedWorld * (1 + 1e-9);
}

/// How much splitting a brick gives: points wished for, for each that there is.
inline double benefitOfSplit(double spacingWorld, double wishedWorld) {
    const double ratio = spacingWorld / wishedWorld;
    return ratio * ratio * ratio;
}

/// Throws InputError for numbers that aren't finite, an empty box or a radius that isn't positive.
void checkFocus(std::span<const Focus> focus);

/// Whether bricks around `b` would differ so little from those around `a` that they aren't worth their time:
/// the same number of places, each moved by less than two finest spacings and a sixteenth of its radius, with
/// radii that differ by less than a sixteenth, and the same half-spaces but for as much.
bool isJitter(std::span<const Focus> a, std::span<const Focus> b, double finestSpacingWorld);

}  // namespace tessera
