#pragma once

#include <cstdint>
#include <vector>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "tessera/execution.h"

namespace tessera {

/// Where one tile's samples are. Without values nothing can be read directly: the tile is absent or belongs
/// to a leaf of another level.
struct TileView {
    const float* values = nullptr;
    const std::uint64_t* coverage = nullptr;  ///< null: every point is covered
    bool covered(int offset) const { return !coverage || ((coverage[offset >> 6] >> (offset & 63)) & 1); }
};

/// A table of the tiles that the cells of every leaf reach, those of the next leaves of the same level
/// included, so that most cells are read without searching. Valid while tree and store stay as they are.
class LeafTiles {
  public:
    struct Leaf {
        Vec3d firstPoint;       ///< in points of its level
        double inverseSpacing;  ///< 1 / world units
        int firstCell;          ///< cells from this one on, on every axis, read stored samples only
    };

    LeafTiles(const BrickTree& tree, const BrickStore& store, const Execution& execution);

    const Leaf& leaf(std::size_t leaf) const { return leaves_[leaf]; }
    /// Tile (x, y, z) of a leaf's closed box is at (x * edge() + y) * edge() + z.
    const TileView* tiles(std::size_t leaf) const { return views_.data() + leaf * stride_; }
    int edge() const { return edge_; }

  private:
    void viewOwn(std::size_t leaf);
    void viewNeighbours(std::size_t leaf);

    const BrickTree* tree_;
    const BrickStore* store_;
    int edge_;
    std::size_t stride_;
    std::vector<Leaf> leaves_;
    std::vector<TileView> views_;
};

/// Whether a leaf of a coarser level touches this one: its border is then interpolated from there.
bool hasCoarserNeighbour(const BrickTree& tree, std::size_t leaf);

}  // namespace tessera
