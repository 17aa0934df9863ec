#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tessera/error.h"
#include "tessera/execution.h"
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

/// How much there is to sample, as far as it is known: by it "auto" predicts times.
struct WorkSize {
    std::int64_t elements = 1'000'000;
    std::int64_t points = 256 * 256 * 256;
};

struct ResamplerChoice {
    const Resampler* resampler = nullptr;
    /// Auto: a sentence for the user, which one and why; else empty.
    std::string reason;
    /// Auto: the others that it could have been, the quickest first.
    std::vector<const Resampler*> others;
};

/// The resampler of that name, or, for "auto", the one that is predicted to take the least time among those
/// that can run here with these options and are exact to 2^-8 voxel. Where there are several, what they cost
/// is measured, which takes a fifth of a second beside the start of drivers, and kept for other processes in
/// $XDG_CACHE_HOME/tessera or ~/.cache/tessera, if that can be written. What auto chooses depends on the
/// machine, and so do the bits of the result: it is never the default. Throws InputError when there is none,
/// with each one's reason, or when the named one can't run here or doesn't have the options; GlError when
/// that is for want of OpenGL.
ResamplerChoice chooseResampler(std::string_view name, const BindOptions& options = {},
                                const WorkSize& work = {}, const Execution& execution = {});
/// The same among given ones.
ResamplerChoice chooseResampler(std::span<const Resampler* const> candidates, std::string_view name,
                                const BindOptions& options, const WorkSize& work = {},
                                const Execution& execution = {});

/// Where "auto" chose a resampler that failed on its device: the one that it goes on with, from the start,
/// the quickest that needs no device. None where a name was given, or there is no other one.
/// @param failure what the device said.
std::optional<ResamplerChoice> chooseInstead(const ResamplerChoice& failed, const std::string& failure);

/// work(*choice.resampler). Where OpenGL fails on the way and there is a resampler instead, that becomes the
/// choice, and the work is done once more, from its beginning.
template <class Work>
auto runChosen(ResamplerChoice& choice, const Work& work) {
    try {
        return work(*choice.resampler);
    } catch (const GlError& error) {
        std::optional<ResamplerChoice> other = chooseInstead(choice, error.what());
        if (!other) throw;
        choice = std::move(*other);
    }
    return work(*choice.resampler);
}

}  // namespace tessera
