#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "gl/gl_functions.h"

namespace tessera {

/// What went through the function table of the contexts made with recordGlCalls(). One thread at a time.
struct GlCalls {
    /// Lines, each a call with its numbers, but for names of objects and places of memory.
    std::string calls;
    std::vector<std::string> texts;  ///< of shaders, as ShaderSource takes them

    static GlCalls& recorded() {
        static GlCalls all;
        return all;
    }
    /// What was recorded since the last call.
    static GlCalls take() { return std::exchange(recorded(), {}); }

    std::int64_t countOf(const std::string& name) const {
        std::int64_t count = 0;
        for (std::size_t at = 0; (at = calls.find(name, at)) != std::string::npos; ++at) ++count;
        return count;
    }
};

/// A function of the table that tells of its calls and then does what it did.
template <auto Member, class Function>
struct RecordedGlCall;
template <auto Member, class Result, class... Arguments>
struct RecordedGlCall<Member, Result (*)(Arguments...)> {
    static inline Result (*real)(Arguments...) = nullptr;
    static inline std::string_view name;

    static Result call(Arguments... arguments) {
        std::string words(name);
        // Objects are unsigned too, so those numbers are told only of what makes them: kinds and formats.
        [[maybe_unused]] const bool makes = name.starts_with("Create") || name.starts_with("Gen");
        [[maybe_unused]] const bool stores = name.find("Storage") != std::string_view::npos;
        [[maybe_unused]] std::size_t at = 0;
        [[maybe_unused]] const auto tell = [&](const auto& argument) {
            using Argument = std::decay_t<decltype(argument)>;
            const bool isObject = stores && at++ == 0;
            if constexpr (std::is_arithmetic_v<Argument>)
                if (!std::is_same_v<Argument, GLuint> || ((makes || stores) && !isObject))
                    words += " " + std::to_string(argument);
        };
        (tell(arguments), ...);
        GlCalls::recorded().calls += words + "\n";
        if constexpr (std::is_same_v<Result (*)(Arguments...), PFNGLSHADERSOURCEPROC>) tellText(arguments...);
        return real(arguments...);
    }
    static void tellText(GLuint, GLsizei count, const GLchar* const* texts, const GLint*) {
        std::string text;
        for (GLsizei i = 0; i < count; ++i) text += texts[i];
        GlCalls::recorded().texts.push_back(text);
    }
};

/// For GlContextOptions::replace.
inline void recordGlCalls(GlFunctions& gl) {
#define TESSERA_RECORD_GL(TYPE, NAME)                                                 \
    {                                                                                 \
        using Call = RecordedGlCall<&GlFunctions::NAME, decltype(GlFunctions::NAME)>; \
        Call::real = gl.NAME;                                                         \
        Call::name = #NAME;                                                           \
        gl.NAME = Call::call;                                                         \
    }
    TESSERA_GL_FUNCTIONS(TESSERA_RECORD_GL)
#undef TESSERA_RECORD_GL
}

}  // namespace tessera
