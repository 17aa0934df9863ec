#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "benchmark/benchmark_variants.h"
#include "benchmark/timed_cases.h"
#include "refine/brick_result.h"
#include "refine/refine_options.h"
#include "tessera/mesh.h"

namespace tessera {

/// Bricks made from a mesh by one variant: planned, bound and sampled, as `tessera resample` does between
/// reading and writing.
struct BrickCase {
    const BenchmarkVariant* variant = nullptr;
    const TetMesh* mesh = nullptr;  ///< its field 0 is sampled
    std::string criterion;          ///< "uniform", "element size", "error", "focus"
    std::string asked;              ///< "128 points"
    RefineOptions refine;
    double bound = 0;             ///< of the largest error, share of the range; 0: none
    bool isErrorMeasured = true;  ///< false: of meshes that only time counts of

    // Found out by prepare.
    FieldError error;
    std::string stoppedBecause;  ///< BrickResult
    double measureMs = 0;
    int levels = 0;
    std::int64_t voxels = 0, covered = 0;
    double spacingWorld = 0;
    // Found out besides, where it is.
    std::optional<double> pictureRms;
    std::optional<std::int64_t> peakMemoryBytes;
};

/// @param points along the longest axis.
BrickCase uniformCase(const BenchmarkVariant& variant, const TetMesh& mesh, int points);
/// @param samples along a typical element edge.
BrickCase elementSizeCase(const BenchmarkVariant& variant, const TetMesh& mesh, double samples);
/// @param bound share of the range.
BrickCase errorCase(const BenchmarkVariant& variant, const TetMesh& mesh, double bound);
/// Finest in a ball in the middle of the bounds, a sixteenth of their longest side in radius.
BrickCase focusCase(const BenchmarkVariant& variant, const TetMesh& mesh, int points);

/// What is run; refers to the case, which must stay where it is. By error, measuring is part of the time, as
/// it decides where to refine; otherwise it isn't.
TimedCase timedCase(BrickCase& bricks, const std::string& ladder);

/// All at once, with its error, of that mesh: the case's, or one like it.
BrickResult makeBricks(const BrickCase& bricks, const TetMesh& mesh, const Execution& execution);

/// As the document has it.
Json runJson(const BrickCase& bricks, const TimedCase& times);

}  // namespace tessera
