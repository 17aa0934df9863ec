#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "mesh/element_index.h"
#include "tessera/lattice.h"
#include "tessera/resampler.h"

namespace tessera {

/// No resampler looks for elements further than this beyond a lattice point.
inline constexpr double kNearMarginVoxels = 0x1p-4;

/// A mesh with the fields that a resampler is bound to, and the elements near boxes of a lattice.
class BoundMesh {
  public:
    BoundMesh(const TetMesh& mesh, std::span<const int> fields, const BindOptions& options);

    const TetMesh& whole() const { return index_->mesh(); }
    std::span<const int> fields() const { return fields_; }
    Route route() const { return route_; }

    /// The elements that can reach the boxes, ascending. Null where a pass over the whole mesh is to be
    /// taken. Several threads may call at once.
    std::optional<std::vector<std::int32_t>> elementsNear(const Lattice& lattice,
                                                          std::span<const IndexBox> boxes,
                                                          const Execution& execution) const;
    /// Some elements, ascending, as a mesh of their own whose fields are the bound ones. Elements and nodes
    /// keep their order, so samples have the same bits.
    TetMesh part(std::span<const std::int32_t> elements) const;
    /// part() of elementsNear().
    std::optional<TetMesh> near(const Lattice& lattice, std::span<const IndexBox> boxes,
                                const Execution& execution) const;

  private:
    bool wantsIndex(const Lattice& lattice, std::span<const IndexBox> boxes) const;
    double volumeWorld() const;

    std::vector<int> fields_;
    Route route_;
    std::shared_ptr<const SharedElementIndex> index_;
    bool isShared_;
    mutable std::once_flag measured_;
    mutable double volumeWorld_ = 0;      ///< of the box of all nodes
    mutable std::atomic<int> passes_{0};  ///< for boxes that are a small part of the mesh
};

/// Whether no more than so many elements can reach points of a box, and not many times as many lie between
/// them.
bool areFewNear(const ElementIndex& index, const Lattice& lattice, const IndexBox& box,
                std::int64_t elements);

/// Holds every place less than `marginVoxels` away from a lattice point of the box, along each lattice axis.
Box3d boundsWorld(const Lattice& lattice, const IndexBox& box, double marginVoxels);

}  // namespace tessera
