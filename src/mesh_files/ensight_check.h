#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tessera {

/// An EnSight case with the files that it names.
struct EnSightCase {
    std::int64_t bytes = 0;                     ///< of all
    std::map<std::string, std::int64_t> named;  ///< path and bytes of those named; none is empty
};
/// Throws InputError when one of the files is a pipe or a device, at which VTK's reader would wait for ever,
/// or lies outside `folder`. Any word of the case may be a file's name; a run of * in one is any characters.
EnSightCase checkEnSightCase(const std::string& path, const std::optional<std::string>& folder);

/// A sentence when some of the files end as none does that was written to its end, within a line of text or a
/// binary number: VTK's reader makes up values there.
std::vector<std::string> findCutOffFiles(const EnSightCase& files);

}  // namespace tessera
