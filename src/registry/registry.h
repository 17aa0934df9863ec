#pragma once

#include <span>
#include <string_view>

#include "resample/resampler.h"

namespace tessera {

/// Every resampling algorithm, available on this machine or not, in the order of preference for tests and
/// listings.
std::span<const Resampler* const> resamplers();

/// Throws InputError, listing the names there are, when there is none of that name, or, with its reason, when
/// it can't run here.
const Resampler& findResampler(std::string_view name);

}  // namespace tessera
