#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "job/field_selection.h"
#include "job/import_mesh.h"
#include "job/run_report.h"
#include "mesh/field_range.h"
#include "resample/cut_plane.h"

namespace tessera {

/// What `tessera slice` is asked for: a plane of any orientation through a mesh, as a picture.
struct CutRequest {
    std::string input, output;  ///< output: a .exr or .png file; "-": standard output
    std::string format;         ///< of standard output: "exr" or "png"; empty: the first
    CutOptions cut;
    std::string algorithm = "software";
    BindOptions bind;
    std::vector<FieldChoice> fields;             ///< empty: all in a .exr file, the first in a .png file
    std::optional<int> component;                ///< .png: of a vector; none: its length
    std::optional<std::array<double, 2>> range;  ///< .png: values at the ends of the colour map
    int timeStep = -1;                           ///< ReadOptions::timeStep
    std::optional<RepairOptions> repair;
};

/// Wall milliseconds.
struct CutTimes {
    double readMs = 0, indexMs = 0, queryMs = 0, resampleMs = 0, writeMs = 0;
};

/// What became of it.
struct CutResult {
    ImportedMesh file;
    std::string algorithm, algorithmReason;  ///< as chosen, and for "auto" why
    Cut cut;
    std::string target;  ///< the code path that sampled it
    ResampleStatistics statistics;
    std::vector<std::string> channelNames;  ///< one a channel that was written
    std::vector<ValueRange> ranges;         ///< of the same
    CutTimes times;
};

/// Throws InputError for a request that no mesh can meet, or this one doesn't, and IoError.
CutResult cutMesh(const CutRequest& request, Job& job);
Json cutJson(const CutRequest& request, const CutResult& result, const Job& job);

}  // namespace tessera
