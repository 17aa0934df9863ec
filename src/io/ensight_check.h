#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tessera {

/// An EnSight case with the files that it names.
struct EnSightCase {
    std::int64_t bytes = 0;
    /// A sentence for every file that ends as none does that was written to its end: VTK's reader makes up
    /// values there.
    std::vector<std::string> warnings;
};
/// Throws InputError when one of the files is a pipe or a device, at which VTK's reader would wait for ever.
EnSightCase checkEnSightCase(const std::string& path);

}  // namespace tessera
