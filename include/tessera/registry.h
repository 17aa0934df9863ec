#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "tessera/resampler.h"

namespace tessera {

/// Every resampling algorithm, available on this machine or not, in the order of preference for tests and
/// listings: those of the library, then those that were added.
std::span<const Resampler* const> resamplers();

/// Adds an algorithm of the caller's own to what names, "auto", reports and comparisons find. Not beside
/// other calls of this header: call it when the program starts. Throws InputError when the name is taken, or
/// "auto".
void registerResampler(std::unique_ptr<const Resampler> resampler);

/// Throws InputError, listing the names there are, when there is none of that name, or, with its reason, when
/// it can't run here.
const Resampler& findResampler(std::string_view name);

/// The same, also when it can't run here: for its name and bounds. Throws InputError, listing the names there
/// are, when there is none of that name.
const Resampler& namedResampler(std::string_view name);

struct ResamplerChoice {
    const Resampler* resampler = nullptr;
    /// Auto: a sentence for the user, which one and why; else empty.
    std::string reason;
};

/// The resampler of that name, or, for "auto", the one with the least Resampler::relativeCost() among those
/// that can run here with these options and are exact to 2^-8 voxel. What auto chooses depends on the
/// machine, and so do the bits of the result: it is never the default. Throws InputError when there is none,
/// with each one's reason, or when the named one can't run here or doesn't have the options.
ResamplerChoice chooseResampler(std::string_view name, const BindOptions& options = {});
/// The same among given ones.
ResamplerChoice chooseResampler(std::span<const Resampler* const> candidates, std::string_view name,
                                const BindOptions& options);

}  // namespace tessera
