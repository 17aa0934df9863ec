#include "registry/registry.h"

#include <array>
#include <string>

#include "base/error.h"
#include "software/software_resampler.h"

namespace tessera {

std::span<const Resampler* const> resamplers() {
    static const SoftwareResampler software;
    static const std::array<const Resampler*, 1> all{&software};
    return all;
}

const Resampler& findResampler(std::string_view name) {
    std::string names;
    for (const Resampler* resampler : resamplers()) {
        if (resampler->name() == name) {
            const std::string reason = resampler->unavailableReason();
            if (!reason.empty())
                throw InputError("algorithm " + std::string(name) + " can't run here: " + reason);
            return *resampler;
        }
        names += (names.empty() ? "" : ", ") + std::string(resampler->name());
    }
    throw InputError("no algorithm named " + std::string(name) + "; there are: " + names);
}

}  // namespace tessera
