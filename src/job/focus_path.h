#pragma once

#include <string>
#include <vector>

#include "tessera/vec.h"

namespace tessera {

/// The places of a text file, world units: a line each, `x y z` with spaces or commas between. `#` begins a
/// comment; blank lines are passed over. Throws InputError naming the file and the line, and for a file
/// without a place.
std::vector<Vec3d> readFocusPath(const std::string& path);

}  // namespace tessera
