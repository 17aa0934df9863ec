#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "tessera/error.h"
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
/// it can't run here; GlError when that is for want of OpenGL.
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
/// with each one's reason, or when the named one can't run here or doesn't have the options; GlError when
/// that is for want of OpenGL.
ResamplerChoice chooseResampler(std::string_view name, const BindOptions& options = {});
/// The same among given ones.
ResamplerChoice chooseResampler(std::span<const Resampler* const> candidates, std::string_view name,
                                const BindOptions& options);

/// Where "auto" chose a resampler that failed on its device: the one that it goes on with, from the start,
/// among those that need no device. None where a name was given, or no other one has the options.
/// @param failure what the device said.
std::optional<ResamplerChoice> chooseInstead(const ResamplerChoice& failed, const std::string& failure,
                                             const BindOptions& options);

/// work(*choice.resampler). Where OpenGL fails on the way and there is a resampler instead, that becomes the
/// choice, and the work is done once more, from its beginning.
template <class Work>
auto runChosen(ResamplerChoice& choice, const BindOptions& options, const Work& work) {
    try {
        return work(*choice.resampler);
    } catch (const GlError& error) {
        std::optional<ResamplerChoice> other = chooseInstead(choice, error.what(), options);
        if (!other) throw;
        choice = std::move(*other);
    }
    return work(*choice.resampler);
}

}  // namespace tessera
