#pragma once

#include <span>
#include <string>
#include <vector>

#include "gl/gl_program.h"
#include "render/effect.h"

namespace tessera {

/// GLSL that calls the functions of all effects, for each place that some effect has one for; and before it
/// the names of all these, for effects that ask others.
struct HookTexts {
    std::string heads, functions;
    std::vector<ShaderDefine> defines;
};
/// @param only for one of the places, such as &Effect::hide.
HookTexts hookTextsOf(std::span<const Effect> effects, std::string Effect::*only = nullptr);

}  // namespace tessera
