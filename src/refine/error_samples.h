#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "brick/seams.h"
#include "refine/node_set.h"
#include "tessera/mesh.h"

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
/// node n, sample nodes + e the centroid of element e. Cheap to make: places are computed when asked for.
class SampledMesh {
  public:
    SampledMesh(const TetMesh& mesh, std::span<const int> fields, const Execution& execution);

    const TetMesh& mesh() const { return *mesh_; }
    std::span<const SampledField> fields() const { return fields_; }
    int channels() const { return channels_; }
    std::size_t nodeCount() const { return mesh_->points.size(); }
    std::size_t count() const { return mesh_->points.size() + mesh_->tets.size(); }
    /// Relative to `originWorld`, so that places near it keep their digits.
    Vec3d placeWorld(std::size_t sample, const Vec3d& originWorld) const {
        if (sample < nodeCount()) return mesh_->points[sample] - originWorld;
        const auto& tet = mesh_->tets[sample - nodeCount()];
        return centroidWorld(mesh_->points[std::size_t(tet[0])], mesh_->points[std::size_t(tet[1])],
                             mesh_->points[std::size_t(tet[2])], mesh_->points[std::size_t(tet[3])],
                             originWorld);
    }
    /// A node: centroids are summed relative to it.
    const Vec3d& reference() const { return reference_; }
    /// Centroid of four nodes, relative to `originWorld`.
    Vec3d centroidWorld(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d,
                        const Vec3d& originWorld) const {
        return 0.25 * (((a - reference_) + (b - reference_)) + ((c - reference_) + (d - reference_))) +
               (reference_ - originWorld);
    }
    /// A cell's value, a node's value, or the mean of an element's four.
    double exactValue(std::size_t sample, const Field& field, int component) const {
        if (sample < nodeCount()) return field.at(std::int64_t(sample), component);
        const std::size_t element = sample - nodeCount();
        if (field.location == FieldLocation::cell) return field.at(std::int64_t(element), component);
        const auto& tet = mesh_->tets[element];
        return 0.25 * (field.at(tet[0], component) + field.at(tet[1], component) +
                       field.at(tet[2], component) + field.at(tet[3], component));
    }

  private:
    const TetMesh* mesh_;
    std::vector<SampledField> fields_;
    int channels_ = 0;
    Vec3d reference_{0};
};

/// |volume| from six times the volume, world units. One that underflows or cancels to 0 in double still
/// belongs to an element that is there.
inline double elementVolume(double sixfold) {
    return std::max(std::abs(sixfold) / 6, std::numeric_limits<double>::denorm_min());
}

/// The samples that exist, and the elements' volumes. Flat elements have no sample, and neither have nodes
/// that only flat elements use.
class ErrorSamples : public SampledMesh {
  public:
    ErrorSamples(const TetMesh& mesh, std::span<const int> fields, const Execution& execution);

    bool exists(std::size_t sample) const {
        return sample < nodeCount() ? nodes_.contains(sample) : volume_[sample - nodeCount()] > 0;
    }
    /// |volume|, world units; 0 exactly when the element is flat.
    double volumeWorld(std::size_t element) const { return volume_[element]; }

  private:
    std::vector<double> volume_;
    NodeSet nodes_;
};

/// In place of a sample's leaf: no leaf holds it, or there is no such sample.
inline constexpr std::int32_t kOutsideLeaves = -1, kNoSample = -2;

/// The leaf that holds a place given in index space of level 0, or kOutsideLeaves.
std::int32_t leafOfPlace(const BrickTree& tree, const Vec3d& index0);

inline bool contains(const Box3d& box, const Vec3d& p) {
    return p.x >= box.min.x && p.y >= box.min.y && p.z >= box.min.z && p.x <= box.max.x && p.y <= box.max.y &&
           p.z <= box.max.z;
}

/// Samples ordered by leaf: those of leaf i are ids[first[i]] to ids[first[i + 1] - 1], ascending.
struct SamplesByLeaf {
    std::vector<std::size_t> first;
    std::vector<std::uint32_t> ids;
    std::span<const std::uint32_t> of(std::size_t leaf) const {
        return std::span(ids).subspan(first[leaf], first[leaf + 1] - first[leaf]);
    }
};
SamplesByLeaf sortSamples(const ErrorSamples& samples, const BrickTree& tree,
                          const std::optional<Box3d>& boundsWorld, const Execution& execution);

/// Evaluates reconstruction at the samples of one leaf after the other. One object a thread.
class LeafSampler {
  public:
    LeafSampler(const SampledMesh& samples, const BrickTree& tree, const BrickStore& store,
                const Reconstruction& reconstruction);
    void enter(std::size_t leaf);
    /// Writes |reconstructed - exact| of every field: NaN when either isn't finite, -1 for a cell field at a
    /// node. Returns the least source among the corners that have a say.
    PointSource measure(std::size_t sample, std::span<double> errors);

  private:
    struct Corners {
        const Tile* tile[8];
        int offset[8];
    };
    bool readCorners(const Vec3i& cell, Corners& corners) const;
    PointSource reconstructSlowly(const CellPlace& place);
    bool fieldErrors(std::size_t sample, std::span<double> errors) const;

    const SampledMesh* samples_;
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
    std::vector<PointSource> slotSource_;
};

}  // namespace tessera
