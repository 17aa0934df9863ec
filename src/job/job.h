#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "base/timer.h"
#include "job/wrap_text.h"
#include "reader/isolated_reader.h"
#include "reader/reader_limits.h"
#include "tessera/execution.h"

namespace tessera {

/// The work behind one command: what it runs with, and whom it tells what comes of it.
struct Job {
    using Listener = std::function<void(const std::string&)>;

    Execution execution;
    std::optional<IsolatedReader> reader;  ///< reads meshes in a separate process; none: this one reads
    /// Makes tetrahedra of surfaces and points; none: it isn't installed.
    std::optional<IsolatedReader> tetrahedralizer;
    IsolationLimits readerLimits;               ///< of that process
    bool followsLinks = false;                  ///< meshes may name files outside their folder
    std::size_t textWidth = kUsualTextWidth;    ///< columns that tables keep to
    Listener say = [](const std::string&) {};   ///< text for a person, as the work goes on: whole lines
    Listener warn = [](const std::string&) {};  ///< one sentence about something odd
    /// One sentence: a result isn't what was asked for.
    Listener fellShort = [](const std::string&) {};
    /// Where the caller will write the document of the job: nothing else may stand there. Empty: nowhere.
    std::string reportPath;
    std::int64_t readPeakBytes = 0;  ///< the largest MeshFile::readPeakBytes so far
};

/// Largest memory of the job: of this process, or, where that is more, of the one that read a mesh and this
/// one together at that time.
inline std::int64_t peakMemoryBytes(const Job& job) {
    return std::max<std::int64_t>(peakMemoryBytes(), job.readPeakBytes);
}

}  // namespace tessera
