#pragma once

#include <cstdint>
#include <string>

namespace tessera {

/// Bytes of an EnSight case and of the files that it names. Throws InputError when one of them is a pipe or a
/// device, at which VTK's reader would wait for ever.
std::int64_t checkEnSightCase(const std::string& path);

}  // namespace tessera
