#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "gl/gl_program.h"
#include "tessera/vec.h"

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

/// A compute program in use, whose uniforms are set by name.
struct ComputeUse {
    GlContext& context;
    const GlProgram& program;

    const GlFunctions& gl() const { return context.functions(); }
    GLint at(const char* name) const { return program.uniform(name); }
    void bind(GLuint binding, const GlBuffer& buffer) const {
        gl().BindBufferBase(GL_SHADER_STORAGE_BUFFER, binding, buffer.id());
    }
    void set(const char* name, std::size_t value) const {
        gl().ProgramUniform1ui(program.id(), at(name), GLuint(value));
    }
    void set(const char* name, const Vec3i& value) const {
        gl().ProgramUniform3i(program.id(), at(name), value.x, value.y, value.z);
    }
    void set(const char* name, const Vec3d& value) const {
        gl().ProgramUniform3d(program.id(), at(name), value.x, value.y, value.z);
    }
    void flag(const char* name, bool value) const { gl().ProgramUniform1i(program.id(), at(name), value); }
    /// What it writes may be read by whatever follows.
    void run(std::size_t threads) const {
        const auto groups = groupsOf(threads);
        gl().UseProgram(program.id());
        gl().DispatchCompute(groups[0], groups[1], groups[2]);
        gl().MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT |
                           GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT);
    }
};

/// Makes room for so many bytes; what stood there is lost.
void grow(GlContext& context, GlBuffer& buffer, std::size_t bytes);

/// Every word of the buffer's first bytes.
void fill(GlContext& context, const GlBuffer& buffer, std::size_t bytes, GLuint word = 0);

/// Waits for the device.
template <class T>
std::vector<T> readItems(GlContext& context, const GlBuffer& buffer, std::size_t first, std::size_t count) {
    std::vector<T> items(count);
    context.functions().GetNamedBufferSubData(buffer.id(), GLintptr(first * sizeof(T)),
                                              GLsizeiptr(count * sizeof(T)), items.data());
    return items;
}

}  // namespace tessera
