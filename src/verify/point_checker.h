#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mesh/field_range.h"
#include "tessera/execution.h"
#include "tessera/lattice.h"
#include "tessera/resampler.h"
#include "verify/voxel_mesh.h"

namespace tessera {

/// What the samples of one algorithm are held to.
struct SampleBounds {
    double spillVoxels = 0;  ///< ResamplerInfo::spillBoundVoxels
    double placeVoxels = 0;  ///< ResamplerInfo::placeBoundVoxels
    SampleFormat format = SampleFormat::r32f;
    std::vector<std::uint8_t> isHalf;  ///< by channel: values were rounded to half floats; empty: none
    bool wholeVectors = false;  ///< a component that isn't finite takes the other two of a vector with it
};

/// What is expected of a lattice point.
enum class PointRule : std::uint8_t {
    sample,    ///< coverage as the mesh's, and values that an element there explains
    coverage,  ///< coverage alone
    absent,    ///< no coverage: it isn't stored
};

/// How samples measure against clauses 1 to 4 of the contract. Counts are of lattice points.
struct PointCheck {
    std::int64_t covered = 0;
    std::int64_t holes = 0;        ///< well inside an element, not covered
    std::int64_t spills = 0;       ///< covered, further than the bound from every element
    std::int64_t wrongValues = 0;  ///< no element within the bound explains the values
    /// Explained only by elements so thin that double can't tell their inside; counted as right when the
    /// values lie between those of the nodes.
    std::int64_t undecided = 0;
    double largestShare = 0;   ///< largest difference over what clause 4 allows, at points that are right
    std::string firstProblem;  ///< one sentence; empty when there is none

    bool isGood() const { return holes == 0 && spills == 0 && wrongValues == 0; }
    PointCheck& operator+=(const PointCheck& later);
};

/// Checks samples point by point against the mesh, in double: every element is laid over the lattice points
/// around it. It shares no code with the resamplers. The contract suite does the same exactly; this is fast
/// enough for whole grids.
class PointChecker {
  public:
    /// `mesh` and `voxels` must outlive it.
    /// @param fields what the blocks were sampled with.
    /// @param reachVoxels elements at most this far from a point count for `thinnestVoxels`.
    PointChecker(const TetMesh& mesh, const VoxelMesh& voxels, std::span<const int> fields,
                 double reachVoxels);

    /// Checks blocks of one box, each of another algorithm, and adds to checks[i] what block i gives.
    /// @param thinnestVoxels by offset in the box: the least thickness of the elements that a point lies in
    /// or near, infinite where there is none.
    /// @param rules by offset in the box; empty: all are samples.
    void check(std::span<const Block> blocks, std::span<const SampleBounds> bounds,
               std::span<PointCheck> checks, std::vector<float>& thinnestVoxels, const Execution& execution,
               std::span<const PointRule> rules = {}) const;

  private:
    struct Channel {
        const Field* field;
        int component;
        ValueRange range;
    };
    class Tile;

    const TetMesh& mesh_;
    const VoxelMesh& voxels_;
    std::vector<Channel> channels_;
    double reachVoxels_;
};

}  // namespace tessera
