#pragma once

#include <string>

namespace tessera::bench {

/// Reads a .vtu file by VTK's reader, which uses one thread; returns milliseconds. Throws std::runtime_error.
double readByVtk(const std::string& path);

}  // namespace tessera::bench
