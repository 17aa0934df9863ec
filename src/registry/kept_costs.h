#pragma once

#include <map>
#include <string>

#include "registry/cost_model.h"

namespace tessera {

/// By costKey().
using KeptCosts = std::map<std::string, CostModel>;

/// What a measured cost holds for: the program's version, the processor and its threads, the algorithm, its
/// target and format, and of OpenGL who makes primitives and the driver. Opens no driver in this process that
/// was tried in another.
std::string costKey(const Resampler& resampler, const BindOptions& options, const Execution& execution);

/// "algorithm_times.json" in $XDG_CACHE_HOME/tessera or ~/.cache/tessera; empty where there is neither.
std::string costsPath();

/// What is kept there. A file that is missing, damaged or too large holds nothing, an entry that isn't sane
/// isn't there.
KeptCosts readCosts(const std::string& path);

/// Adds to what is kept there, as far as that can be written.
void keepCosts(const std::string& path, const KeptCosts& added);

}  // namespace tessera
