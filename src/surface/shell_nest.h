#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "surface/triangle_tree.h"
#include "tessera/execution.h"

namespace tessera {

/// Shells, each closed, that cross neither themselves nor one another: their volumes and which lies in which.
/// Where they cross answers are the same every time, and may be wrong. Refers to the tree and to `shellOf`.
class ShellNest {
  public:
    /// @param shellOf of every triangle, -1: of none. @param shells how many there are.
    ShellNest(const TriangleTree& tree, std::span<const std::int32_t> shellOf, std::size_t shells,
              const Execution& execution);

    /// World units cubed, below 0 of shells that look inwards; the sign is exact, the value finite.
    std::vector<double> volumesWorld(const Execution& execution) const;
    /// For every shell those that it lies in, ascending. Throws InputError where boxes of shells overlap so
    /// much that this takes too long, as the next does.
    std::vector<std::vector<std::int32_t>> shellsAround(const Execution& execution) const;
    /// For every shell a place in it, off all triangles and outside of the shells in it, far from all that
    /// among a few; a place on it where there is no such double, or none was found.
    std::vector<Vec3d> placesInside(const std::vector<double>& volumesWorld,
                                    const std::vector<std::vector<std::int32_t>>& around,
                                    const Execution& execution) const;

  private:
    /// Where a triangle stands on the line through a place along an axis.
    enum class Standing : std::uint8_t { beside, before, at, behind };
    /// Between the next triangles on both sides of a place; infinite where there is none.
    struct Gap {
        double low, high;
    };
    struct Candidate {
        Vec3d place{0};
        double clearance = -1;
    };

    std::span<const std::int32_t> trianglesOf(std::size_t shell) const {
        return std::span(byShell_).subspan(std::size_t(begin_[shell]),
                                           std::size_t(begin_[shell + 1] - begin_[shell]));
    }
    void count(std::int64_t looked) const;
    Standing standingOf(std::int32_t triangle, int axis, const Vec3d& place) const;
    Gap gapAt(std::size_t shell, int axis, const Vec3d& place, std::int32_t exceptTriangle) const;
    Gap gapAlong(int axis, const Vec3d& place, double lowest, double highest,
                 std::int32_t exceptTriangle) const;
    std::vector<std::int32_t> oddShells(const Vec3d& place, double farthest) const;
    Vec3d ownPlace(std::size_t shell, std::span<const std::int32_t> shellOfPoint) const;
    Candidate candidateAt(std::size_t shell, std::int32_t triangle, int inwards,
                          std::span<const std::int32_t> around) const;
    bool isInside(std::size_t shell, const Vec3d& place, std::span<const std::int32_t> around) const;
    Vec3d placeInside(std::size_t shell, int inwards, std::span<const std::int32_t> around) const;

    const TriangleTree& tree_;
    std::span<const std::int32_t> shellOf_;
    std::vector<std::int64_t> begin_;
    std::vector<std::int32_t> byShell_;  // triangles, ascending in each
    std::vector<Box3d> boxes_;           // of the shells
    mutable std::atomic<std::int64_t> looked_{0};
};

}  // namespace tessera
