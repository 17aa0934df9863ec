#pragma once

#include <string>
#include <vector>

#include "job/run_report.h"

namespace tessera {

/// The document of a benchmark as one HTML page that needs no other file, no network and no script: readable
/// on phones and wide screens, light and dark, and printed. What the document lacks is left out.
std::string benchmarkPage(const Json& document);

/// A plot of the page as an SVG file, in fixed colours on white.
struct PlotFile {
    std::string name;  ///< "error-against-time"
    std::string svg;
};
/// Those that the document has something for.
std::vector<PlotFile> benchmarkPlots(const Json& document);

}  // namespace tessera
