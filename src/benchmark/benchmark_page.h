#pragma once

#include <string>

#include "job/run_report.h"

namespace tessera {

/// The document of a benchmark as one HTML page that needs no other file, no network and no script: readable
/// on phones and wide screens, light and dark, and printed. What the document lacks is left out.
std::string benchmarkPage(const Json& document);

/// The plots that can stand alone.
enum class PlotKind {
    timeAtEqualError,
    timeAtEqualRms,
    errorAgainstTime,
    timeAgainstResolution,
    timeAgainstElements,
    stages,
    voxelsAgainstError,
    roofline,
    ownErrors,
    pictureErrors,
    paperSpeedUps,
    noise,
};

/// One plot of the page as an SVG file, in fixed colours on white. Empty if the document has nothing for it.
std::string benchmarkPlotSvg(const Json& document, PlotKind kind);

}  // namespace tessera
