#pragma once

#include <string>

#include "benchmark/page_source.h"

namespace tessera {

// Where time goes and how it grows, as sections of HTML, which are empty where the document
// has nothing for them; and their plots, which have no panels then.

/// @param axis "resolution" or "elements".
std::string scalingSection(const PageSource& source, const std::string& axis);
PlotFigure scalingFigure(const PageSource& source, const std::string& axis);

std::string stagesSection(const PageSource& source);
PlotFigure stagesFigure(const PageSource& source);

std::string rooflineSection(const PageSource& source);
PlotFigure rooflineFigure(const PageSource& source);

/// Runs on a mesh that is bound already.
std::string warmSection(const PageSource& source);

}  // namespace tessera
