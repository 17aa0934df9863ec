#pragma once

#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "brick/depth.h"
#include "brick/seams.h"
#include "mesh/element_index.h"
#include "refine/brick_plan.h"
#include "refine/error_samples.h"
#include "refine/refine_options.h"
#include "refine/visible_values.h"
#include "tessera/lattice.h"

namespace tessera {

/// What a brick's samples show when they are compared with the mesh.
struct BrickFindings {
    /// The largest error of a bounded field over its bound, of vectors the length of the difference.
    float worst = 0;
    /// Of the watched channel, ascending; bins without a sample and without an error are left out.
    std::vector<BinFinding> bins;
};

/// Compares the trilinear reconstruction within one brick with the mesh: at the nodes and the centroids of
/// elements that lie in it. Several threads may call it at once.
class BrickInspector {
  public:
    /// The mesh of the index must outlive it. @param watched a channel whose values are put into bins.
    /// Throws InputError for bounds that can't hold.
    BrickInspector(std::shared_ptr<const SharedElementIndex> index, std::span<const int> fields,
                   const RefineOptions& options, int watched, const Execution& execution);

    /// Finite values of the watched channel in the mesh.
    const ValueRange& watchedRange() const { return range_; }
    /// The bound on the watched channel's error, in bins; infinite when that has none.
    double watchedBoundBins() const { return watchedBoundBins_; }
    /// In the field's unit.
    double watchedBound() const {
        return boundOfField_[std::size_t(channelOf_[std::size_t(watched_)].first)];
    }
    /// Bins that values of these elements lie in, those between their nodes too.
    ValueMask binsOf(std::span<const std::int32_t> elements) const;

    /// All channels at a lattice point on the border of a brick's closed box.
    using BorderValues = std::function<void(const Vec3i& p, std::span<double> values)>;

    /// From the samples of the brick's closed box: a corner outside the mesh takes the value of the nearest
    /// mesh point. Without `border` what it finds depends on the mesh and the brick only.
    /// @param border when given: values that take the place of the samples on the border.
    BrickFindings inspect(const DepthKey& key, const Block& samples, const PlanFrame& frame,
                          const BorderValues& border = {}) const;

  private:
    class Corners;

    std::shared_ptr<const SharedElementIndex> index_;
    SampledMesh mesh_;
    std::vector<double> boundOfField_;            ///< infinite where there is none
    std::vector<std::pair<int, int>> channelOf_;  ///< (field among those of mesh_, component)
    int watched_;
    ValueRange range_;
    double watchedBoundBins_;
    NearestOnDemand nearest_;
};

}  // namespace tessera
