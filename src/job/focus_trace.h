#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "job/field_selection.h"
#include "job/focus_error.h"
#include "job/import_mesh.h"
#include "job/run_report.h"

namespace tessera {

/// What `tessera focus-trace` is asked for: bricks that follow a focus along a path, step by step.
struct FocusTraceRequest {
    std::string input, path;  ///< the mesh, and what readFocusPath() reads
    std::string output;       ///< a .csv or .html file; "-": standard output; empty: none
    std::string format;       ///< of standard output: "csv" or "html"; empty: the first
    double radiusWorld = 0;   ///< Focus::radiusWorld
    int resolution = 0;       ///< lattice points along the longest axis, of the finest spacing; 0: not given
    double spacingWorld = 0;  ///< the finest; 0: not given. Neither: that of 256 points
    int brickCells = 16;
    std::int64_t budgetBytes = 1'000'000'000;  ///< of bricks in memory
    double frameMs = 8;                        ///< of one update
    std::string algorithm = "software";
    BindOptions bind;
    std::vector<FieldChoice> fields;  ///< empty: all
    int timeStep = -1;                ///< ReadOptions::timeStep
    std::optional<RepairOptions> repair;
};

/// One place of the path, from the focus moving there until everything is at rest.
struct FocusStep {
    Vec3d placeWorld{0};
    /// False: so near to the last focus that nothing changes (BrickScheduler::setFocus).
    bool moved = false;
    /// Until the leaf that holds the place was shown finer than before, the first time at all in the first
    /// step. None where it didn't become finer.
    std::optional<double> betterMs;
    double restMs = 0;
    std::int64_t sampled = 0, reused = 0, dropped = 0;  ///< bricks
    // At rest:
    std::int64_t leaves = 0, voxels = 0, bytes = 0;
    std::optional<double> spacingWorld;  ///< at the place; none where no brick holds it
    FocusError error;                    ///< within the radius
    bool cutShort = false;               ///< the budget holds fewer bricks than are wished for
};

/// Wall milliseconds. build: the scheduler without its samples.
struct FocusTraceTimes {
    double readMs = 0, indexMs = 0, buildMs = 0, traceMs = 0, writeMs = 0;
};

/// What became of it.
struct FocusTrace {
    ImportedMesh file;
    std::string algorithm, algorithmReason;  ///< as chosen, and for "auto" why
    std::string target;                      ///< the code path that sampled
    std::string errorField;                  ///< whose first component was compared; empty: none could be
    double finestSpacingWorld = 0;
    std::vector<FocusStep> steps;  ///< one at least
    ResampleStatistics statistics;
    FocusTraceTimes times;
};

/// Of several times: none without any.
struct TimeFigures {
    std::size_t count = 0;
    double medianMs = 0, p99Ms = 0;
};
/// Of the steps behind the first, which begins with nothing, without those that moved too little.
struct FocusSummary {
    std::size_t moves = 0, tooSmall = 0;
    TimeFigures better, rest;
};
FocusSummary summarize(const std::vector<FocusStep>& steps);

/// Moves a focus from place to place, at each until everything is at rest, and writes what it cost. Throws
/// InputError for a request that no mesh can meet, or this one doesn't, and IoError.
FocusTrace traceFocus(const FocusTraceRequest& request, Job& job);
/// @param number of the step, from 1 on.
Json focusStepJson(const FocusStep& step, std::size_t number);
Json focusTraceJson(const FocusTraceRequest& request, const FocusTrace& trace, const Job& job);

}  // namespace tessera
