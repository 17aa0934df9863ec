#pragma once

#include <cstdint>
#include <string>

namespace tessera {

bool isProgram(const std::string& path);

/// The installed program tessera: the one of useProgram, or else in PATH. Empty: there is none.
std::string findProgram();

/// Has that program, where there is one, try drivers before an algorithm uses them in this process.
/// @param maxMemoryBytes see GlTrial.
void tryDriversFor(const std::string& algorithm, std::int64_t maxMemoryBytes = 0);

}  // namespace tessera
