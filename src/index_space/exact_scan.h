#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "index_space/element_depth.h"
#include "index_space/node_frame.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"
#include "tessera/vec.h"

namespace tessera {

/// What is sampled.
struct ScanInput {
    const TetMesh& mesh;
    const NodeFrame& frame;
    std::span<const ScanChannel> channels;
};

/// How a scan marks the points that it covers: by one that starts a run, whose owner is noted there, and by
/// those that follow it along x.
inline constexpr std::uint8_t kNotCovered = 0, kFollowsInRun = 1, kStartsRun = 2;

/// Bit of `owner` that says that `rank` holds the owner's rank.
inline constexpr std::int32_t kRankKnown = 1 << 30;
inline constexpr std::int32_t kElementMask = kRankKnown - 1;

/// Where the samples go: arrays over `blockBox`, of which a scan fills only `region`.
struct ScanOutput {
    IndexBox region;
    IndexBox blockBox;
    std::int64_t stride[3];          ///< of x, y and z: 1, nx, nx ny
    std::span<float* const> values;  ///< one array a channel
    std::uint8_t* marks;             ///< kNotCovered at the start
    std::int32_t* owner;             ///< at the start of a run: the covering element, perhaps with kRankKnown
    double* rank;  ///< ElementDepth::rank of the owner, written when a point becomes contested

    /// The element that owns a covered point.
    std::int32_t ownerAt(std::int64_t offset) const {
        while (marks[offset] == kFollowsInRun) --offset;
        return owner[offset] & kElementMask;
    }

    std::int64_t offset(const Vec3i& p) const {
        const Vec3i q = p - blockBox.min;
        return q.x * stride[0] + q.y * stride[1] + q.z * stride[2];
    }
    Vec3i pointAt(std::int64_t offset) const {
        return blockBox.min +
               Vec3i{int(offset % stride[1]), int(offset % stride[2] / stride[1]), int(offset / stride[2])};
    }
};

struct ScanCounts {
    std::int64_t scanlines = 0;
    std::int64_t contested = 0;
    std::int64_t exactElements = 0;

    ScanCounts& operator+=(const ScanCounts& other) {
        scanlines += other.scanlines;
        contested += other.contested;
        exactElements += other.exactElements;
        return *this;
    }
};

/// True when `element`, which covers the point with this rank, owns it rather than the present owner. Updates
/// marks, owner and rank, not the values.
bool contestPoint(const ScanInput& input, const ScanOutput& output, std::int32_t element, double rank,
                  std::int64_t offset);

/// Takes note that `element` covers a point. True when the point takes the element's values.
/// @param rank gives the element's rank there, where that is needed.
template <class Rank>
bool coverPoint(const ScanInput& input, const ScanOutput& output, std::int32_t element, std::int64_t offset,
                ScanCounts& counts, const Rank& rank) {
    if (output.marks[offset] == kNotCovered) {
        output.marks[offset] = kStartsRun;
        output.owner[offset] = element;
        return true;
    }
    ++counts.contested;
    return contestPoint(input, output, element, rank(), offset);
}

/// Samples one element in 113-bit arithmetic or, where that isn't enough, in rationals.
void scanElementExactly(const ScanInput& input, const ScanOutput& output, std::int32_t element,
                        ScanCounts& counts);

/// The ends of single scanlines of one element, decided in 113-bit arithmetic or rationals: for those that
/// double precision can't decide.
class ExactScanlines {
  public:
    /// @param axis the axis scanned, 0 to 2.
    ExactScanlines(const ScanInput& input, std::int32_t element, int axis);
    ~ExactScanlines();
    /// First and last voxel of the scanline relative to the element's first voxel; begin > end when it has
    /// none. @param t, r places along the other two axes in ascending order, relative to the first voxel.
    void ends(double t, double r, double& begin, double& end) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// A point is covered when every barycentric coordinate is at least -T, where T bounds all rounding. T below
/// the first limit keeps a value within 1/16 ulp; T times the element's size below the second keeps a covered
/// point within 2^-26 voxel of the element. Derivation in docs/algorithms.md.
inline constexpr double kLargestSlack = 0x1p-28;
inline constexpr double kLargestSlackTimesSize = 0x1p-29;
/// Widening of an element's bounding box, in voxels; above the rounding of node places.
inline constexpr double kBoxSlack = 0x1p-30;

}  // namespace tessera
