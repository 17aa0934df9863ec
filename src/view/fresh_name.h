#pragma once

#include <string>

namespace tessera {

/// A path at which nothing is yet: the one given, or with the first free number behind its stem,
/// "picture-2.png".
std::string freshName(const std::string& path);

}  // namespace tessera
