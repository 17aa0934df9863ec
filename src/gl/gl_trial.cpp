#include "gl/gl_trial.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <exception>
#include <optional>
#include <string_view>
#include <thread>

#include "base/child_process.h"
#include "base/text.h"
#include "base/timer.h"
#include "gl/gl_platform.h"
#include "gl/gl_program.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr const char* kTask = "that tries OpenGL";
constexpr int kReasonDescriptor = 3;  // of the child: a pipe
constexpr std::string_view kGreeting = "trial\n";
constexpr std::size_t kLongestReason = 512;  // a pipe takes that and the greeting without a reader
constexpr int kExitUnavailable = 3;
constexpr double kLeastSeconds = 1.5;  // of a driver that is tried behind another
constexpr double kTickMs = 2;

const ShaderText kTriangleVert{"trial.vert.glsl", R"(
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1);
    gl_Position = vec4(corner, 0, 1);
}
)"};

const ShaderText kValueFrag{"trial.frag.glsl", R"(
uniform float wanted;
layout(location = 0) out float value;
void main() { value = wanted; }
)"};

const ShaderText kValueComp{"trial.comp.glsl", R"(
layout(local_size_x = 1) in;
layout(r32f, binding = 0) uniform writeonly image2D target;
uniform float wanted;
void main() { imageStore(target, ivec2(3, 0), vec4(wanted)); }
)"};

/// A texel by each call that Tessera draws with. @throws GlError when they don't hold what they should.
void drawTexels(GlContext& context) {
    constexpr int kTexels = 4;
    constexpr float kWanted = 0.625f;
    const GlFunctions& gl = context.functions();
    const GlProgram drawing =
        makeProgram(context, {{GL_VERTEX_SHADER, kTriangleVert}, {GL_FRAGMENT_SHADER, kValueFrag}});
    const GlProgram computing = makeProgram(context, {{GL_COMPUTE_SHADER, kValueComp}});
    for (const GlProgram* program : {&drawing, &computing})
        gl.ProgramUniform1f(program->id(), program->uniform("wanted"), kWanted);
    const std::array<std::uint32_t, 3> corners{0, 1, 2};
    const GlBuffer indices(context, std::span(corners));
    const GlVertexArray array(context);
    gl.VertexArrayElementBuffer(array.id(), indices.id());
    const GlTexture target(context, GL_TEXTURE_2D, GL_R32F, kTexels, 1);
    GlFramebuffer framebuffer(context);
    framebuffer.attach(GL_COLOR_ATTACHMENT0, target);
    framebuffer.throwIfIncomplete();
    gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
    gl.BindVertexArray(array.id());
    gl.UseProgram(drawing.id());
    gl.Viewport(0, 0, 1, 1);
    gl.DrawArrays(GL_TRIANGLES, 0, 3);
    gl.Viewport(1, 0, 1, 1);
    gl.DrawArraysInstanced(GL_TRIANGLES, 0, 3, 1);
    gl.Viewport(2, 0, 1, 1);
    gl.DrawElements(GL_TRIANGLES, 3, GL_UNSIGNED_INT, nullptr);
    gl.UseProgram(computing.id());
    gl.BindImageTexture(0, target.id(), 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R32F);
    gl.DispatchCompute(1, 1, 1);
    gl.MemoryBarrier(GL_TEXTURE_UPDATE_BARRIER_BIT);
    std::array<float, kTexels> got{};
    gl.GetTextureSubImage(target.id(), 0, 0, 0, 0, kTexels, 1, 1, GL_RED, GL_FLOAT, sizeof got, got.data());
    gl.UseProgram(0);
    context.throwIfFailed();
    if (std::any_of(got.begin(), got.end(), [](float value) { return value != kWanted; }))
        throw GlError("the driver draws something else than it is told to");
}

/// A process under trial.
class Trial {
  public:
    /// @param spentMs of tryDrivers' time. @param seconds after which the driver is given up.
    Trial(const GlTrial& trial, const std::string& word, double spentMs, double seconds)
        : endMs_(spentMs + seconds * 1e3), seconds_(seconds) {
        int ends[2];
        if (::pipe2(ends, O_CLOEXEC | O_NONBLOCK) != 0) failToStart(kTask, "pipe", errno);
        reason_ = Descriptor(ends[0]);
        const Descriptor childEnd(ends[1]);
        std::vector<std::string> words = trial.arguments;
        words.push_back(word);
        words.push_back(std::to_string(::getpid()));
        child_.emplace(ChildStart{kTask, trial.executable, words, {childEnd.get()}, {}});
    }

    /// Empty while it runs and may go on.
    std::optional<GlTrialResult> result(double spentMs) {
        const std::optional<ProcessEnd> end = child_->reap();
        if (end) return resultOf(*end);
        if (spentMs < endMs_) return std::nullopt;
        child_.reset();
        return GlTrialResult{"the driver didn't answer within " + shortNumber(seconds_) + " s", true};
    }

  private:
    GlTrialResult resultOf(const ProcessEnd& end) {
        std::array<char, kGreeting.size() + kLongestReason> buffer;
        const ssize_t got = ::read(reason_.get(), buffer.data(), buffer.size());
        std::string_view text(buffer.data(), std::size_t(std::max<ssize_t>(got, 0)));
        // Started was something else, which no driver's code has run in.
        if (!text.starts_with(kGreeting)) return {};
        text.remove_prefix(kGreeting.size());
        if (end.exitCode == 0 && !text.empty()) return {{}, false, std::string(text)};
        if (end.exitCode == kExitUnavailable && !text.empty()) return {std::string(text), false};
        return {"the driver " + (end.bySignal ? end.words : "ended the process that tried it"), true};
    }

    double endMs_, seconds_;
    Descriptor reason_;
    std::optional<ChildProcess> child_;
};

void write(std::string_view text) {
    if (::write(kReasonDescriptor, text.data(), text.size()) != ssize_t(text.size()))
        throw IoError("the reason can't be handed over");
}

}  // namespace

std::vector<GlTrialResult> tryDrivers(const GlTrial& trial, std::span<const std::string> words) {
    std::vector<GlTrialResult> results(words.size());
    std::vector<std::optional<Trial>> trials(words.size());
    const bool isAtOnce = trial.isRoomy();
    std::size_t started = 0;
    double spentMs = 0;
    Timer timer;
    while (true) {
        std::size_t running = 0;
        for (std::size_t i = 0; i < started; ++i) {
            if (!trials[i]) continue;
            if (std::optional<GlTrialResult> result = trials[i]->result(spentMs)) {
                results[i] = std::move(*result);
                trials[i].reset();
            }
            running += trials[i].has_value();
        }
        for (; started < words.size() && (running == 0 || isAtOnce); ++started) {
            const double left = started == 0 || isAtOnce
                                    ? trial.seconds
                                    : std::clamp(trial.seconds - spentMs / 1e3,
                                                 std::min(kLeastSeconds, trial.seconds), trial.seconds);
            try {
                trials[started].emplace(trial, words[started], spentMs, left);
                ++running;
            } catch (const IoError& error) {
                results[started].reason = error.what();
            }
        }
        if (running == 0) return results;
        if (trial.cancel && trial.cancel->load()) throw Cancelled();
        std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(kTickMs));
        // Time in which this process didn't run, stopped by Ctrl-Z say, isn't the driver's.
        spentMs += std::min(timer.restart(), 50 * kTickMs);
    }
}

int serveTrial(std::span<const std::string> arguments,
               const std::function<std::string(const std::string&)>& use) {
    std::int64_t parent = 0;
    const std::string number = arguments.size() == 2 ? arguments[1] : "";
    const auto parsed = std::from_chars(number.data(), number.data() + number.size(), parent);
    if (parsed.ec != std::errc() || ::fcntl(kReasonDescriptor, F_SETFD, FD_CLOEXEC) != 0)
        throw InputError("the trial of OpenGL is started by tessera itself");
    settleAsChild(parent);
    write(kGreeting);
    try {
        write(use(arguments[0]));
    } catch (const std::exception& error) {
        write(std::string_view(error.what()).substr(0, kLongestReason));
        return kExitUnavailable;
    }
    return 0;
}

std::vector<GlTrialResult> tryGl(const GlTrial& trial, std::span<const GlPlatform> platforms) {
    std::vector<std::string> names;
    for (const GlPlatform platform : platforms) names.emplace_back(nameOf(platform));
    return tryDrivers(trial, names);
}

int serveGlTrial(std::span<const std::string> arguments) {
    return serveTrial(arguments, [](const std::string& name) {
        GlContext context(parseGlPlatform(name));
        drawTexels(context);
        return std::string(context.info().isSoftware ? kSoftwareFound : kHardwareFound) +
               driverText(context.info());
    });
}

}  // namespace tessera
