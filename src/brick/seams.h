#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "mesh/nearest_point.h"
#include "tessera/execution.h"

namespace tessera {

/// A value of the reconstruction at a lattice point.
struct SeamValue {
    double value = 0;
    bool covered = false;  ///< in the mesh; else the value is that of the nearest mesh point
};

/// Share of a voxel below which a place counts as lying on a lattice plane: less than stored floats can tell
/// apart, and more than the rounding of a place in index space.
inline constexpr double kOnLatticePlane = 1.0 / (1 << 30);

/// A place inside a brick: its cell, and where in the cell.
struct CellPlace {
    Vec3i cell{0};      ///< local, in [0, B) on every axis
    Vec3d fraction{0};  ///< in [0, 1]; exactly 0 or 1 within 2^-30 of a lattice plane
};
/// @param local place in index space of the brick's level, counted from the brick's first point; may be off
/// by rounding.
inline CellPlace locateInBrick(const Vec3d& local, int brickCells) {
    CellPlace place;
    for (int a = 0; a < 3; ++a) {
        const int cell = int(std::min(std::max(local[a], 0.0), double(brickCells - 1)));
        const double t = local[a] - cell;
        place.cell[a] = cell;
        place.fraction[a] = t < kOnLatticePlane ? 0 : t > 1 - kOnLatticePlane ? 1 : t;
    }
    return place;
}

/// Corner c of a cell is at (c & 1, c >> 1 & 1, c >> 2); its trilinear weight at `fraction`.
inline Vec3i cornerOffset(int c) {
    return {c & 1, (c >> 1) & 1, c >> 2};
}
inline double cornerWeight(const Vec3d& fraction, int c) {
    return (c & 1 ? fraction.x : 1 - fraction.x) * (c & 2 ? fraction.y : 1 - fraction.y) *
           (c & 4 ? fraction.z : 1 - fraction.z);
}

/// A nearest-point index that is built when first asked for: meshes that fill their bricks never need one.
/// Thread-safe.
class NearestOnDemand {
  public:
    NearestOnDemand(const TetMesh& mesh, int threads) : mesh_(&mesh), threads_(threads) {}
    const NearestPointIndex& get() const {
        std::call_once(once_, [this] { index_ = std::make_unique<NearestPointIndex>(*mesh_, threads_); });
        return *index_;
    }

  private:
    const TetMesh* mesh_;
    int threads_;
    mutable std::once_flag once_;
    mutable std::unique_ptr<NearestPointIndex> index_;
};

/// What a lattice point outside the mesh gets that the extension has no value for.
enum class Outside {
    nearest,  ///< the value at the nearest mesh point
    missing,  ///< NaN: a file's reader has nothing there
};

/// Where the reconstruction has a point's value from.
enum class PointSource : std::uint8_t { missing, nearest, extended, covered };

/// Reads the continuous reconstruction: stored samples, except that a lattice point on the border to a
/// coarser brick takes the value that trilinear interpolation in the coarse brick gives there, and a point
/// outside the mesh takes the extension's value, or that at the nearest mesh point. Thread-safe.
class Reconstruction {
  public:
    Reconstruction(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                   const BrickStore& store, const NearestOnDemand& nearest,
                   Outside outside = Outside::nearest);
    /// At point `p` of the lattice of `level`, which must lie in the closed box of a leaf of that level.
    SeamValue at(int level, const Vec3i& p, int channel) const;
    /// The same for several channels at once: values.size() of them from `firstChannel` on; none asks for the
    /// source only. Of an interpolated point the source is the least of those of the corners it depends on.
    /// `p` may lie in the closed box of a leaf of any level, and outside all.
    PointSource resolve(int level, const Vec3i& p, int firstChannel, std::span<double> values) const;
    bool isCovered(int level, const Vec3i& p) const {
        return resolve(level, p, 0, {}) == PointSource::covered;
    }
    using VisitPoint = std::function<void(int level, const Vec3i& p)>;
    /// Calls visit(level, p) for every point that the value at `p` is interpolated from, as a point of the
    /// coarser leaf that it is interpolated in; for `p` itself where it isn't.
    void visitCorners(int level, const Vec3i& p, const VisitPoint& visit) const;
    /// The same for those outside the mesh, as points of the leaf that owns them, or of the last level looked
    /// at when none does.
    void visitOutside(int level, const Vec3i& p, const VisitPoint& visit) const;
    /// All channels at the mesh point nearest to lattice point `p`; NaN where a value isn't finite as a
    /// float, and for a mesh without elements.
    void nearestValues(int level, const Vec3i& p, int firstChannel, std::span<double> values) const;
    /// Trilinear value at a place inside a leaf's closed box, in index space of the leaf's level. @param
    /// coveredCorners receives how many of the cell's corners are in the mesh, when not null (corners of
    /// weight zero have no say and count as if they were).
    double interpolate(std::size_t leaf, const Vec3d& index, int channel,
                       int* coveredCorners = nullptr) const;

  private:
    // A lattice point as a point of its owner, or of the coarser leaf that it is interpolated in.
    struct Owner {
        std::int64_t leaf = -1;  // -1: none
        int level = 0;
        Vec3i point{0};
        bool isInterpolated = false;  // `level` is that of the coarser leaf, `point` is of the asked level
    };
    Owner findOwner(int level, const Vec3i& p) const;
    PointSource fromCoarse(int level, const Vec3i& p, int coarse, int firstChannel,
                           std::span<double> values) const;
    PointSource outside(int level, const Vec3i& p, int firstChannel, std::span<double> values) const;
    const Tile* coveredTile(const Owner& owner) const;

    const TetMesh* mesh_;
    const BrickTree* tree_;
    const BrickStore* store_;
    const NearestOnDemand* nearest_;
    Outside outside_;
    std::vector<std::pair<int, int>> channelOf_;  // (field, component) of each channel
};

}  // namespace tessera
