#pragma once

#include <string>

#include "benchmark/page_source.h"

namespace tessera {

// What errors cost in time and in voxels, as sections of HTML, which are empty where the document
// has nothing for them; and their plots, which have no panels then.

std::string equalErrorSection(const PageSource& source);
/// @param measure "max" or "rms".
PlotFigure equalErrorFigure(const PageSource& source, const std::string& measure);

std::string errorTimeSection(const PageSource& source);
PlotFigure errorTimeFigure(const PageSource& source);

std::string voxelSection(const PageSource& source);
PlotFigure voxelFigure(const PageSource& source);

/// How far pictures of the voxels are from exact ones.
PlotFigure pictureFigure(const PageSource& source);

}  // namespace tessera
