#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "brick/seams.h"
#include "mesh/tet_mesh.h"

namespace tessera {

/// One measured field.
struct SampledField {
    const Field* field = nullptr;
    int firstChannel = 0;
    double range = 0;    ///< largest component range
    double largest = 0;  ///< largest finite |value|
    bool isCell() const { return field->location == FieldLocation::cell; }
};

/// The places where reconstruction is compared with the exact field, the same for every tree: sample n is
/// node n, sample nodes + e the centroid of element e. Flat elements have none, and neither have nodes that
/// only flat elements use.
class ErrorSamples {
  public:
    ErrorSamples(const TetMesh& mesh, std::span<const int> fields, const Execution& execution);

    const TetMesh& mesh() const { return *mesh_; }
    std::span<const SampledField> fields() const { return fields_; }
    int channels() const { return channels_; }
    std::size_t count() const { return usedNode_.size() + volume_.size(); }
    std::size_t nodeCount() const { return usedNode_.size(); }
    bool exists(std::size_t sample) const {
        return sample < usedNode_.size() ? usedNode_[sample] != 0 : volume_[sample - usedNode_.size()] > 0;
    }
    /// Relative to `originWorld`, so that places near it keep their digits.
    Vec3d placeWorld(std::size_t sample, const Vec3d& originWorld) const {
        if (sample < usedNode_.size()) return mesh_->points[sample] - originWorld;
        return centroid_[sample - usedNode_.size()] + (reference_ - originWorld);
    }
    double exactValue(std::size_t sample, const Field& field, int component) const;
    /// |volume|, world units; 0 exactly when the element is flat.
    double volumeWorld(std::size_t element) const { return volume_[element]; }
    std::int64_t flatElements() const { return flat_; }
    std::int64_t invertedElements() const { return inverted_; }

  private:
    const TetMesh* mesh_;
    std::vector<SampledField> fields_;
    int channels_ = 0;
    Vec3d reference_{0};  // a node: centroids are kept relative to it
    std::vector<Vec3d> centroid_;
    std::vector<double> volume_;
    std::vector<std::uint8_t> usedNode_;
    std::int64_t flat_ = 0, inverted_ = 0;
};

/// Samples ordered by leaf: those of leaf i are ids[first[i]] to ids[first[i + 1] - 1], ascending.
struct SamplesByLeaf {
    std::vector<std::size_t> first;
    std::vector<std::uint32_t> ids;
    std::int64_t outside = 0;  ///< samples in no leaf, or outside the bounds
    std::span<const std::uint32_t> of(std::size_t leaf) const {
        return std::span(ids).subspan(first[leaf], first[leaf + 1] - first[leaf]);
    }
};
SamplesByLeaf sortSamples(const ErrorSamples& samples, const BrickTree& tree,
                          const std::optional<Box3d>& boundsWorld, const Execution& execution);

/// Evaluates reconstruction at the samples of one leaf after the other. One object a thread.
class LeafSampler {
  public:
    LeafSampler(const ErrorSamples& samples, const BrickTree& tree, const BrickStore& store,
                const Reconstruction& reconstruction);
    void enter(std::size_t leaf);
    /// Writes |reconstructed - exact| of every field: NaN when either isn't finite, -1 for a cell field at a
    /// node. Returns whether every corner that has a say is in the mesh.
    bool measure(std::size_t sample, std::span<double> errors);

  private:
    struct Corners {
        const Tile* tile[8];
        int offset[8];
    };
    bool readCorners(const Vec3i& cell, Corners& corners) const;
    bool reconstructSlowly(const CellPlace& place);
    bool fieldErrors(std::size_t sample, std::span<double> errors) const;

    const ErrorSamples* samples_;
    const BrickTree* tree_;
    const BrickStore* store_;
    const Reconstruction* reconstruction_;
    std::size_t leaf_ = 0;
    Vec3i firstPoint_{0};
    double inverseSpacing_ = 1;
    bool coarserNear_ = false;
    std::vector<double> values_;  // reconstruction of all channels
    // Corner values that took the long way, by local point of the closed box.
    std::vector<std::int32_t> slotOf_;
    std::vector<std::int32_t> touched_;
    std::vector<double> slotValues_;
    std::vector<std::uint8_t> slotCovered_;
};

}  // namespace tessera
