#pragma once

#include <string>

#include "benchmark/page_source.h"

namespace tessera {

// What speaks for the figures: the exact oracle, the paper, how it was measured, as sections of HTML, which
// are empty where the document has nothing for them; and their plots, which have no panels then.

/// The algorithms' own errors, and those of pictures.
std::string exactnessSection(const PageSource& source);
PlotFigure oracleFigure(const PageSource& source);

std::string paperSection(const PageSource& source);
PlotFigure paperFigure(const PageSource& source);

/// What got faster or slower since an earlier run.
std::string comparisonSection(const PageSource& source);

std::string methodSection(const PageSource& source);
/// A variant timed as two.
PlotFigure noiseFigure(const PageSource& source);

}  // namespace tessera
