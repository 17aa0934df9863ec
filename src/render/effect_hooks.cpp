#include "render/effect_hooks.h"

namespace tessera {

namespace {

/// Text of a function that calls those of all effects; none, and no define, where no effect has one.
struct Hook {
    const char* define;
    std::string Effect::*function;
    const char* head;    // of the function
    const char* first;   // what stands before the calls,
    const char* before;  // before the name of each,
    const char* behind;  // behind it,
    const char* last;    // and behind them all
};

constexpr const char* kSum = "    vec4 sum = vec4(0);\n";
constexpr const char* kAdd = "    sum += (1.0 - sum.a) * ";
constexpr const char* kReturnSum = "    return sum;\n";

constexpr Hook kHooks[] = {
    {"SHADE", &Effect::shade, "void shadeByEffects(inout vec4 shown, vec3 local, vec3 direction)", "", "    ",
     "(shown, local, direction);\n", ""},
    {"SHEET", &Effect::sheet,
     "vec4 sheetByEffects(float codeBegin, float codeEnd, vec3 begin, vec3 end, vec3 direction)", kSum, kAdd,
     "(codeBegin, codeEnd, begin, end, direction);\n", kReturnSum},
    {"SHEET", &Effect::hasSheet, "bool haveSheet(float codeBegin, float codeEnd)", "", "    if (",
     "(codeBegin, codeEnd)) return true;\n", "    return false;\n"},
    {"FACE", &Effect::face, "vec4 faceByEffects(vec3 local)", kSum, kAdd, "(local);\n", kReturnSum},
    {"CLASSIFY", &Effect::classify,
     "vec4 classifyByEffects(float codeBegin, float codeEnd, float layers, out float share)", "",
     "    return ", "(codeBegin, codeEnd, layers, share);\n", ""},
    {"SURFACE", &Effect::surfaceDistance, "float surfaceBehind(vec3 origin, vec3 direction, float after)",
     "    float next = 1e38;\n", "    next = min(next, ", "(origin, direction, after));\n",
     "    return next;\n"},
    {"SURFACE", &Effect::surface, "vec4 surfaceByEffects(vec3 local, vec3 origin, vec3 direction, float at)",
     kSum, kAdd, "(local, origin, direction, at);\n", kReturnSum},
    {"HIDE", &Effect::hide, "bool isHiddenByEffects(vec3 origin, vec3 direction, float at)", "", "    if (",
     "(origin, direction, at)) return true;\n", "    return false;\n"},
};

}  // namespace

HookTexts hookTextsOf(std::span<const Effect> effects, std::string Effect::*only) {
    HookTexts texts;
    for (const Hook& hook : kHooks) {
        if (only && hook.function != only) continue;
        std::string calls;
        for (const Effect& effect : effects)
            if (const std::string& function = effect.*hook.function; !function.empty())
                calls += hook.before + function + hook.behind;
        if (calls.empty()) continue;
        texts.defines.push_back({hook.define});
        texts.heads += std::string(hook.head) + ";\n";
        texts.functions += std::string(hook.head) + " {\n" + hook.first + calls + hook.last + "}\n";
    }
    return texts;
}

}  // namespace tessera
