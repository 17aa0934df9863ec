#pragma once

#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "tessera/execution.h"
#include "tessera/vec.h"

namespace tessera {

/// One channel of an EXR picture: 32-bit floats, row by row from the top left. What stands before a dot
/// inside a name is a layer, and programs such as Blender open a file that has layers as several pictures.
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
    /// What a viewer shows: indices into `channels` of those that are written a second time, as R, G, B and
    /// A. kExrZeros: a channel of zeros. Empty: the file has no R, G, B, A.
    std::vector<int> shown;
};

inline constexpr int kExrZeros = -1;

/// Names of the channels of a field with some components: its own for one, "U_x", "U_y", "U_z" for two or
/// three, "S_0", "S_1", ... for more. Dots become underscores: no name makes a layer.
std::vector<std::string> exrChannelNames(const std::string& field, int components);

/// Whether a channel of this name beside R, G, B and A would be shown in place of one of them: Blender takes
/// the first channel whose last letter is R, of either case, as R (likewise G, B and A), and knows Red, AR
/// and such.
bool isShownAsColour(const std::string& channel);

/// Writes one part of scan lines, compressed without loss; the same bytes for the same picture. Nothing
/// stands at `path` until the file is whole. Throws InputError for channels that clash or have no name,
/// IoError (not writable, disk full), Cancelled.
void writeExr(const std::string& path, const ExrImage& image, const Execution& execution);

}  // namespace tessera
