#pragma once

#include <string>
#include <vector>

#include "compare/compare_resamplers.h"
#include "options.h"

namespace tessera {

/// Algorithms that a command runs one after the other.
struct AlgorithmList {
    std::vector<Contestant> contestants;
    std::vector<std::string> absent;  ///< one sentence for each that can't run here; only when none was named
};

/// "software,slicing:osmesa": names, each with a target of its own if wanted. Empty: every algorithm that can
/// run here. OpenGL platform, sample format and classification go to those that have a choice of them. Throws
/// InputError for a name or target there isn't, or that can't run here.
AlgorithmList listAlgorithms(const std::string& names, const AlgorithmArguments& options);

/// What `resampler` is bound with: the options, as far as it has a choice of them.
BindOptions bindOptionsFor(const Resampler& resampler, const AlgorithmArguments& options);

/// `edge` halved until a box of that many points an axis takes at most 1 GiB for all algorithms together.
int affordableBoxEdge(int edge, int channels, std::size_t algorithms);

}  // namespace tessera
