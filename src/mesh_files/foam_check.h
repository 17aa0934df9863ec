#pragma once

#include <string>
#include <vector>

namespace tessera {

/// Warns when the parts that a parallel run left hold later times than the whole OpenFOAM case, which is what
/// is read. Throws InputError when the case has parts only.
/// @param path the .foam file in the case's folder.
std::vector<std::string> checkFoamCase(const std::string& path);

}  // namespace tessera
