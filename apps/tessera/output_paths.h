#pragma once

#include <string>
#include <vector>

namespace tessera {

/// A file that a command writes, and the option that named it.
struct OutputPath {
    std::string option;
    std::string path;
};

/// Throws InputError when an output is the same file as an input, one that a .pvd file among them names, or
/// another output, under whatever name: links and relative paths are followed. Empty paths, and "-" for
/// --json, name no file and are passed over.
void checkOutputPaths(const std::vector<std::string>& inputs, const std::vector<OutputPath>& outputs);

}  // namespace tessera
