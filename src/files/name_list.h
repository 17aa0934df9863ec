#pragma once

#include <string>
#include <vector>

namespace tessera {

/// "a, b, c" for a message; a long list ends with "and 12 more".
std::string nameList(const std::vector<std::string>& names);

}  // namespace tessera
