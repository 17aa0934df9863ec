#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/execution.h"
#include "lattice/block.h"
#include "mesh/tet_mesh.h"

namespace tessera {

/// What one call to BoundResampler::resample did. Counts are exact; times are wall milliseconds.
struct ResampleStatistics {
    std::int64_t elementBlockPairs = 0;  ///< elements that may touch a block, summed over blocks
    std::int64_t exactElements = 0;      ///< of these, pairs that needed more than double precision
    std::int64_t scanlines = 0;          ///< scanlines (or slice polygons) visited
    std::int64_t contested = 0;          ///< points that more than one element covered
    std::int64_t coveredPoints = 0;
    double binMs = 0;     ///< element lists
    double sampleMs = 0;  ///< everything after, the sink included

    ResampleStatistics& operator+=(const ResampleStatistics& other);
};

/// Receives each finished block once: called concurrently from worker threads, in any order; the block lives
/// for the call only.
using BlockSink = std::function<void(std::size_t boxIndex, const Block& block)>;

/// A resampler with a mesh and a choice of fields. The mesh must outlive it and stay unchanged.
class BoundResampler {
  public:
    virtual ~BoundResampler() = default;

    /// The code path in use, one of Resampler::targets().
    virtual std::string_view target() const { return "default"; }

    /// Samples the boxes of one lattice. Boxes may overlap and lie anywhere. The values and coverage of a
    /// lattice point depend on the mesh and that point only: not on the boxes, threads or processor. Throws
    /// InputError for a lattice that can't be used (spacing not positive and finite, indices beyond 2^30) or
    /// a box of more than 2^31 - 1 points.
    virtual ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                        const BlockSink& sink, const Execution& execution) = 0;
};

/// One resampling algorithm. Every one meets the contract in docs/algorithms.md: no holes, no spill beyond
/// spillBoundVoxels(), no overshoot, bounded error, the same bits always.
class Resampler {
  public:
    virtual ~Resampler() = default;
    virtual std::string_view name() const = 0;         ///< as on the command line, e.g. "software"
    virtual std::string_view description() const = 0;  ///< one line
    /// Empty when this machine can run it, else the reason why not.
    virtual std::string unavailableReason() const { return {}; }
    /// Code paths this processor or driver offers, the default first, e.g. "AVX3", "AVX2", "SSE4"; all give
    /// the same bits.
    virtual std::vector<std::string> targets() const { return {"default"}; }
    /// Largest true distance from the mesh, in voxels, at which a point may be covered (contract clause 2).
    virtual double spillBoundVoxels() const = 0;
    /// Distance in voxels within which the interpolated place may differ from the lattice point (contract
    /// clause 4).
    virtual double placeBoundVoxels() const = 0;
    /// @param fields indices into mesh.fields; channels of the blocks are their components, in this order.
    /// @param target one of targets(), or empty for the default.
    virtual std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                                 std::string_view target = {}) const = 0;
};

/// Convenience for single use: samples one box into one block.
Block resampleBlock(const Resampler& resampler, const TetMesh& mesh, std::span<const int> fields,
                    const Lattice& lattice, const IndexBox& box, const Execution& execution = {});

}  // namespace tessera
