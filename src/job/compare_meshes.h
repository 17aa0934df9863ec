#pragma once

#include <optional>
#include <string>
#include <vector>

#include "job/field_selection.h"
#include "job/job.h"
#include "job/run_report.h"
#include "mesh/repair.h"
#include "tessera/resampler.h"

namespace tessera {

/// What `tessera compare` is asked for.
struct CompareRequest {
    std::vector<std::string> meshes;
    std::string algorithms;           ///< see listAlgorithms; the first is what the others are compared with
    BindOptions bind;                 ///< of those that have a choice
    std::vector<FieldChoice> fields;  ///< empty: all
    std::optional<int> resolution;    ///< lattice points along the longest axis; not given: 128
    std::optional<double> spacing;    ///< of the lattice, world units, in place of it
    int runs = 3;                     ///< of each algorithm, for the times
    int boxEdge = 128;                ///< points along the edge of the boxes sampled at once, at most
    int timeStep = -1;                ///< ReadOptions::timeStep
    bool markdown = false;            ///< says one table in Markdown
    std::optional<RepairOptions> repair;
};

struct Comparison {
    std::vector<std::string> problems;  ///< a sentence for each way in which the algorithms don't agree
    std::vector<std::string> absent;    ///< AlgorithmList::absent
    Json meshes = Json::array();        ///< a document a mesh
};

/// Samples each mesh by several algorithms on one lattice. Throws InputError and GlError.
Comparison compareMeshes(const CompareRequest& request, Job& job);
Json comparisonJson(const Comparison& comparison, const Job& job);

}  // namespace tessera
