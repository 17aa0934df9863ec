#pragma once

#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/execution.h"
#include "base/vec.h"

namespace tessera {

/// One channel of an EXR picture: 32-bit floats, row by row from the top left. Viewers show what stands
/// before the last dot of a name as a layer: "U.x", "U.y" and "U.z" are a layer U.
struct ExrChannel {
    std::string name;
    std::vector<float> values;  ///< width x height
};

/// A named value in the file's header: a text, a number or a vector ("string", "double", "v3d").
using ExrAttribute = std::pair<std::string, std::variant<std::string, double, Vec3d>>;

struct ExrImage {
    int width = 0;
    int height = 0;
    std::vector<ExrChannel> channels;
    std::vector<ExrAttribute> attributes;
};

/// Names of the channels of a field with some components: its own for one, "U.x", "U.y", "U.z" for two or
/// three, "S.0", "S.1", ... for more.
std::vector<std::string> exrChannelNames(const std::string& field, int components);

/// Writes one part of scan lines, compressed without loss; the same bytes for the same picture. Nothing
/// stands at `path` until the file is whole. Throws InputError for channels that clash or have no name,
/// IoError (not writable, disk full), Cancelled.
void writeExr(const std::string& path, const ExrImage& image, const Execution& execution);

}  // namespace tessera
