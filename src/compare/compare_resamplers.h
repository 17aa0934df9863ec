#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "compare/difference_meter.h"
#include "compare/run_times.h"
#include "compare/sampling_grid.h"
#include "tessera/resampler.h"
#include "verify/point_checker.h"

namespace tessera {

/// One algorithm of a comparison, with what it runs with.
struct Contestant {
    std::string label;  ///< as printed
    const Resampler* resampler = nullptr;
    BindOptions options;
};

struct CompareOptions {
    int boxEdge = 128;               ///< points along the edge of the boxes that are sampled at once
    int runs = 3;                    ///< of each algorithm, for the times
    double boundaryVoxels = 0x1p-8;  ///< coverage may differ within this of the mesh boundary
    double thinVoxels = 0x1p-4;      ///< differences in elements of less thickness are told apart
};

struct ContestantReport {
    std::string label, target;
    SampleFormat format = SampleFormat::r32f;
    bool meetsContract = true;
    double spillVoxels = 0, placeVoxels = 0;
    PointCheck check;
    double bindMs = 0;
    RunTimes times;
};

/// A field's differences, and what is where they are largest.
struct ValueDifference : FieldDifference {
    Vec3d worstWorld{0};
    std::int32_t worstElement = -1;  ///< the thinnest of the elements there
    double worstThicknessVoxels = 0;
};

/// One algorithm against the first.
struct PairReport {
    std::int64_t coveredByBoth = 0, onlyFirst = 0, onlySecond = 0;
    std::int64_t nearBoundary = 0;  ///< of the points that only one covers, those near the mesh boundary
    std::int64_t awayFromBoundary = 0;
    Vec3i firstAway{0};  ///< lattice point of the first of these
    std::vector<ValueDifference> fields;
};

struct CompareReport {
    SamplingGrid grid;
    std::size_t boxes = 0;
    std::vector<ContestantReport> contestants;
    std::vector<PairReport> pairs;  ///< one for each contestant but the first
    /// No coverage differs away from the boundary, and every sample is right.
    bool agrees() const;
};

/// Runs the contestants over the same boxes of one lattice: `runs` times for the times, then box by box for
/// the differences, so that memory holds one box of each at a time. Throws what binding and resampling throw,
/// and InputError when there is no contestant.
CompareReport compareResamplers(const TetMesh& mesh, std::span<const int> fields,
                                std::span<const Contestant> contestants, const SamplingGrid& grid,
                                const CompareOptions& options, const Execution& execution);

}  // namespace tessera
