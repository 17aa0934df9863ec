#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "base/large_pages.h"
#include "brick/leaf_tiles.h"
#include "refine/error_samples.h"
#include "refine/measure_kernel.h"

namespace tessera {

/// Samples on their way with all their channels: nodes, or elements' centroids.
struct SampleBatch : MeasureBatch {
    SampleBatch(int channels, std::size_t fields)
        : MeasureBatch{}, exact(std::size_t(channels)), errors(fields) {}

    std::uint32_t first = 0;          ///< sample of the first lane
    LaneBits samples = 0;             ///< the lanes that are samples: the others are flat elements
    LaneBits inLeaves = 0;            ///< those that lie in a leaf
    std::vector<LaneDoubles> exact;   ///< one a channel
    std::vector<LaneDoubles> errors;  ///< one a field: |reconstructed - exact| where kept

    /// All corners' addresses in the lanes whose cells reach several tiles, or one that isn't full.
    std::array<std::array<std::int64_t, 8>, kMeasureLanes> corners;
    std::array<std::uint8_t, kMeasureLanes> scattered;
    std::size_t scatteredCount = 0;
    LaneCorners values;  ///< of one channel
};

/// Measures samples a batch at a time where reconstruction reads stored samples alone. Valid while tree and
/// store stay as they are; several threads may share one.
class BatchSampler {
  public:
    struct ElementCounts {
        std::int64_t flat = 0, inverted = 0;
    };

    BatchSampler(const SampledMesh& samples, const BrickTree& tree, const BrickStore& store,
                 const Execution& execution);

    /// Places and exact values of nodes `first`, first + 1, ... None has a volume.
    void gatherNodes(std::int64_t first, int count, SampleBatch& batch) const;
    /// The same of elements' centroids, and the elements' volumes.
    ElementCounts gatherElements(std::int64_t first, int count, SampleBatch& batch) const;
    /// Finds the leaf of every sample in the batch. @param bounds samples outside are in no leaf; from the
    /// tree's origin.
    void findLeaves(const Box3d& bounds, SampleBatch& batch) const;
    /// Errors of all samples of the batch whose cells are made of stored samples: those are kept.
    void measure(SampleBatch& batch) const;

  private:
    void gatherChannels(std::int64_t first, SampleBatch& batch) const;
    LaneDoubles& nearChannel(SampleBatch& batch) const;
    void findPlainTiles();
    void findCorners(SampleBatch& batch) const;
    bool findScattered(std::size_t lane, SampleBatch& batch) const;
    void readCorners(int channel, SampleBatch& batch) const;

    // From a cell's first corner to its corners: tiles of the table, and points in the tile.
    struct CornerSteps {
        std::array<std::int64_t, 8> tile, point;  // points in bytes
    };
    static std::array<CornerSteps, 8> makeCornerSteps(int edge);

    const SampledMesh& samples_;
    const TetMesh& mesh_;
    const BrickTree& tree_;
    LeafTiles tiles_;
    std::size_t stride_;  // tiles of a leaf
    BrickTree::Walk walk_;
    std::vector<std::int64_t> plainTiles_;    // see measure::findCorners
    std::array<CornerSteps, 8> cornerSteps_;  // by MeasureBatch::beyond
    std::vector<float> zeros_;          // what is read where there are no corners: a tile of every channel
    const Field* nearField_ = nullptr;  // the first one at nodes, whose first component is at hand:
    int nearChannel_ = -1;
    UninitializedVector<FourDoubles> nodes_;  // place and that component, fetched together
};

}  // namespace tessera
