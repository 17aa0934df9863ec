#pragma once

#include <string>
#include <vector>

#include "compare/compare_resamplers.h"

namespace tessera {

/// Algorithms that a command runs one after the other.
struct AlgorithmList {
    std::vector<Contestant> contestants;
    /// One sentence for each that can't run here, or not with the options; only when none was named.
    std::vector<std::string> absent;
};

/// "software,slicing:osmesa,hybrid:processor": names, each with a target of its own, and behind it who makes
/// its primitives, if wanted. Empty: every algorithm that meets the contract and can run here. OpenGL
/// platform and sample format go to those that have a choice.
/// Throws InputError for a name or target there isn't, or that can't run here.
AlgorithmList listAlgorithms(const std::string& names, const BindOptions& options);

/// What `resampler` is bound with: the options, as far as it has a choice of them.
BindOptions bindOptionsFor(const Resampler& resampler, BindOptions options);

/// Why the resampler can't be bound with the options; empty when it can.
std::string whyNotBound(const Resampler& resampler, const BindOptions& options);

/// The format's name when it isn't r32f, which loses nothing; else empty.
std::string lossyFormat(const BindOptions& options);

/// `edge` halved until a box of that many points an axis takes at most 1 GiB for all algorithms together.
int affordableBoxEdge(int edge, int channels, std::size_t algorithms);

}  // namespace tessera
