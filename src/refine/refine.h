#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/execution.h"
#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "mesh/nearest_point.h"
#include "mesh/tet_mesh.h"
#include "refine/error_report.h"
#include "resample/resampler.h"

namespace tessera {

enum class Criterion { uniform, elementSize, error };
enum class ErrorMeasure { max, rms };

/// A frame that the plan must use: the lattice of another file, or of the first step of a time series.
struct FixedFrame {
    Vec3d originWorld{0};
    double spacingWorld = 1;  ///< h_0
};

struct RefineOptions {
    Criterion criterion = Criterion::elementSize;
    int brickCells = 16;  ///< 8, 16, 32 or 64
    int resolution = 0;   ///< lattice points along the longest axis of the bounds (the finest level); 0: not
                          ///< given. They run exactly from the bounds' minimum to their maximum
    double spacingWorld = 0;       ///< finest spacing; 0: not given
    double samplesPerElement = 2;  ///< element-size: lattice points along a typical element edge
    int maxLevels = 0;    ///< number of nested levels at most; 0: 8 for element-size, no bound for error
    double maxError = 0;  ///< error: bound, in field units or as a share of each field's range
    bool maxErrorIsRelative = true;
    ErrorMeasure measure = ErrorMeasure::max;
    std::vector<int>
        errorFields;  ///< indices into mesh.fields that the bound holds for; empty: all point fields chosen
    std::int64_t maxVoxels =
        0;  ///< bound on stored points (leaves x B^3); 0: a default from the memory there is
    std::int64_t maxMemoryBytes = 0;   ///< bound on the samples' memory; 0: no bound of its own
    std::optional<Box3d> boundsWorld;  ///< keep only the points that reading inside this box needs
    std::optional<FixedFrame> frame;   ///< instead of resolution and spacing; level 0 is then its spacing,
                                       ///< even when no brick is so fine
    BindOptions bind;                  ///< what the resampler runs with
};

/// What a plan would cost, before sampling.
struct PlanEstimate {
    std::int64_t storedPoints = 0;  ///< leaves x B^3
    std::vector<std::int64_t> bricksPerLevel;
    std::int64_t levelsBytes = 0;  ///< samples of all chosen fields, --layout levels
    std::int64_t flatPoints = 0;   ///< points of the same volume at the finest spacing
    std::int64_t flatBytes = 0;
};

/// The chosen leaf bricks. Throws InputError when the smallest sensible plan exceeds maxVoxels or
/// maxMemoryBytes (the message says what would fit). For Criterion::uniform and elementSize; error-driven
/// refinement samples as it goes, see refineAndResample.
/// @param channels components of all fields that will be sampled: what a point costs.
/// @param notes when not null, receives sentences for the user (a plan coarsened to keep a default bound).
BrickTree planBricks(const TetMesh& mesh, const RefineOptions& options, const Execution& execution,
                     int channels = 1, std::vector<std::string>* notes = nullptr);

PlanEstimate estimatePlan(const BrickTree& tree, int channels);

/// Milliseconds of the stages in this layer.
struct BrickTimes {
    double planMs = 0;
    double resampleMs = 0;
    double verifyMs = 0;
};

/// A tree with its samples and its measured error.
struct BrickResult {
    /// What a flat grid was made of (flatten); `tree` and `store` are then the grid's own.
    std::optional<BrickTree> bricks;
    int flatLevel = 0;  ///< of these bricks: the grid's spacing
    /// What the samples' error was before half floats or a coarser grid made another of it.
    std::optional<ErrorReport> samplesReport;
    BrickTree tree;
    BrickStore store;
    ErrorReport report;
    ResampleStatistics statistics;
    std::string target;  ///< the code path that sampled it, one of Resampler::targets()
    BrickTimes times;
    bool bounded = false;            ///< error: the measured error on the final tree is within the bound
    std::string stoppedBecause;      ///< error: empty when bounded, else which budget ended the refinement
    int rounds = 0;                  ///< error: rounds of refinement
    std::vector<std::string> notes;  ///< sentences for the user
};

/// A bound of refinement by error that a report exceeds, as a sentence: which field, by how much, where.
/// Empty when the report keeps to it.
/// @param fields what the report's fields are in the mesh.
std::string exceededBound(const TetMesh& mesh, std::span<const int> fields, const RefineOptions& options,
                          const ErrorReport& report);

/// Samples every leaf of a tree. Neighbouring leaves of one level are sampled in larger blocks than a brick.
BrickStore resampleTree(const BrickTree& tree, BoundResampler& resampler, int channels,
                        const Execution& execution, ResampleStatistics& statistics);

/// Plans, samples and measures: the whole way from a mesh to bricks, by any criterion.
/// @param fields indices into mesh.fields: the channels, in this order.
BrickResult refineAndResample(const TetMesh& mesh, std::span<const int> fields, const Resampler& resampler,
                              const RefineOptions& options, const Execution& execution);

}  // namespace tessera
