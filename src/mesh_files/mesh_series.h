#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace tessera {

/// One step of a time series.
struct SeriesStep {
    std::vector<std::string> files;  ///< the parts of its mesh, in the order of the .pvd file; mostly one
    std::optional<double> time;      ///< only of steps that a .pvd file gives a time
    std::string collection;          ///< that .pvd file; empty for others
    std::size_t number = 0;          ///< its place in the series, counted from 0
};

/// Whether the name is that of a .pvd file.
bool isCollectionName(const std::string& path);

/// The steps of a series, from names as they were typed: mesh files, patterns with * or ?, or one .pvd file.
/// Meshes are steps in the natural order of their names, run_2 before run_10. A .pvd file's steps are in the
/// order of their times: what it lists at one time are the parts of one step. Without any times each file is
/// a step, or all are the parts of one where parts are numbered. Throws InputError, naming file and byte,
/// when nothing matches, a mesh is named twice, a .pvd file stands beside others, is damaged, names what
/// isn't there, is no regular file or is itself a .pvd file, has a time that is no number or some steps
/// without, or has a part of a step twice.
std::vector<SeriesStep> listSeries(std::span<const std::string> inputs);

/// Bounds on times, both included; none where there is no number.
struct TimeRange {
    std::optional<double> first, last;
};

/// The steps in the range; what differs from a bound by 1e-9 of it counts as in it. Throws InputError when
/// there are none, or when the steps have no times.
std::vector<SeriesStep> stepsWithin(const std::vector<SeriesStep>& steps, const TimeRange& range);

}  // namespace tessera
