#pragma once

#include <string_view>

namespace tessera {

/// A file of GLSL, as tessera_embed_glsl() in CMake embeds it.
struct ShaderText {
    std::string_view name;  ///< the file's name, for messages
    std::string_view text;
};

}  // namespace tessera
