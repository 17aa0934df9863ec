#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "gl/gl_program.h"

namespace tessera {

/// Threads of a workgroup, and workgroups along one axis of a dispatch.
inline constexpr std::size_t kGroupThreads = 64, kGroupsARow = 32768;

/// Workgroups of a dispatch of so many threads.
inline std::array<GLuint, 3> groupsOf(std::size_t threads) {
    const std::size_t wanted = (threads + kGroupThreads - 1) / kGroupThreads;
    const std::size_t rows = std::max<std::size_t>(1, (wanted + kGroupsARow - 1) / kGroupsARow);
    return {GLuint((wanted + rows - 1) / rows), GLuint(rows), 1};
}

/// Constants of the host as a compute shader's text knows them; exact.
std::string glslOf(double value);
std::string glslOf(float value);
inline std::string glslOf(std::size_t value) {
    return std::to_string(value) + "u";
}

/// A program of one compute shader; GROUP_THREADS and GROUPS_A_ROW are defined.
GlProgram makeComputeProgram(GlContext& context, const ShaderText& main, std::vector<ShaderText> shared,
                             std::vector<ShaderDefine> defines);

}  // namespace tessera
