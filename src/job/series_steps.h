#pragma once

#include <string>
#include <vector>

#include "job/run_report.h"
#include "mesh_files/mesh_series.h"

namespace tessera {

/// What messages call a step: its file, or its .pvd file with time and number of parts.
std::string nameOf(const SeriesStep& step);

/// A step of a .pvd file. @param number -1: the last. Throws InputError when there is none of that number.
SeriesStep chosenStep(const std::string& collection, int number);

/// How to read a step. @param timeStep of files with several steps, ReadOptions::timeStep.
ReadOptions readOptions(const SeriesStep& step, std::vector<std::string> fields, int timeStep);

/// "a:b", "a:" or ":b". Throws InputError.
TimeRange parseTimes(const std::string& text);

/// Whether an output's name has a place for the step's number.
bool takesNumber(const std::string& pattern);
/// The name with the step's number where it has #### (as many digits at least), or %d, %4d, %04d as printf
/// takes them, and % for %%. Of several runs of # the longest one counts, and none beside a %d. Throws
/// InputError for other formats.
std::string numberedName(const std::string& pattern, std::size_t number);

/// A step's number, time and parts, where it has them: keys of a step's document.
Json stepJson(const SeriesStep& step);

/// What the meshes of a series have in common.
class SeriesSummary {
  public:
    void add(const SeriesStep& step, const TetMesh& mesh);
    const std::vector<FieldSummary>& fields() const { return fields_; }
    const Box3d& boundsWorld() const { return boundsWorld_; }
    /// A sentence for every field that some steps lack.
    std::vector<std::string> notes() const;
    /// The `series` key of a document.
    Json json() const;

  private:
    std::vector<std::optional<double>> times_;  ///< one a step
    Box3d boundsWorld_;
    std::vector<FieldSummary> fields_;
    std::vector<std::size_t> stepsWith_;  ///< one a field
};

}  // namespace tessera
