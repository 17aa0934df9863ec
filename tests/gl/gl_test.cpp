#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <future>
#include <numeric>
#include <thread>

#include "base/sanitizers.h"
#include "gl/gl_program.h"
#include "gl/gl_thread.h"
#include "gl_test/shaders.h"
#include "gl_test_tools.h"
#include "tessera/error.h"

namespace tessera {
namespace {

/// Texels of a one-channel texture as floats, x fastest.
std::vector<float> readTexture(GlContext& context, const GlTexture& texture, int texels) {
    std::vector<float> values(static_cast<std::size_t>(texels), -1);
    context.functions().GetTextureImage(texture.id(), 0, GL_RED, GL_FLOAT,
                                        static_cast<GLsizei>(values.size() * sizeof(float)), values.data());
    return values;
}

std::int64_t residentBytes() {
    std::ifstream file("/proc/self/statm");
    std::int64_t total = 0, resident = 0;
    file >> total >> resident;
    return resident * sysconf(_SC_PAGESIZE);
}

std::string messageOf(const std::function<void()>& action) {
    try {
        action();
    } catch (const GlError& error) {
        return error.what();
    }
    return "";
}

class Gl : public testing::TestWithParam<GlPlatform> {
  protected:
    void SetUp() override { TESSERA_NEEDS_GL(GetParam()); }
};

TEST_P(Gl, GivesACoreContextOf45AndItsLimits) {
    GlThread thread(GetParam());
    const GlDeviceInfo& info = thread.info();
    EXPECT_EQ(info.platform, GetParam());
    EXPECT_FALSE(info.renderer.empty());
    EXPECT_GE(info.version.substr(0, 3), "4.5");
    EXPECT_GE(info.limits.texture3dSize, 256);
    EXPECT_GE(info.limits.subpixelBits, 4);
    const bool isCore = thread.run([](GlContext& context) {
        GLint mask = 0;
        context.functions().GetIntegerv(GL_CONTEXT_PROFILE_MASK, &mask);
        return (mask & GL_CONTEXT_CORE_PROFILE_BIT) != 0;
    });
    EXPECT_TRUE(isCore);
}

TEST_P(Gl, ClearsEveryLayerOfA3dTexture) {
    GlThread thread(GetParam());
    const std::vector<float> values = thread.run([](GlContext& context) {
        const GlTexture texture(context, GL_TEXTURE_3D, GL_R32F, 8, 4, 16);
        GlFramebuffer framebuffer(context);
        framebuffer.attach(GL_COLOR_ATTACHMENT0, texture);
        framebuffer.throwIfIncomplete();
        const float value = 0.1f;
        context.functions().ClearNamedFramebufferfv(framebuffer.id(), GL_COLOR, 0, &value);
        return readTexture(context, texture, 8 * 4 * 16);
    });
    for (const float value : values) ASSERT_EQ(value, 0.1f);
}

TEST_P(Gl, DrawsIntoTheLayerThatTheVertexShaderNames) {
    GlThread thread(GetParam());
    if (!thread.info().hasVertexShaderLayer) GTEST_SKIP() << "gl_Layer can't be written by a vertex shader";
    constexpr int kWidth = 8, kHeight = 4, kLayers = 5;
    const std::vector<float> values = thread.run([](GlContext& context) {
        const GlFunctions& gl = context.functions();
        const GlProgram program = makeProgram(
            context,
            {{GL_VERTEX_SHADER, shaders::gl_test::kLayeredVert},
             {GL_FRAGMENT_SHADER, shaders::gl_test::kLayeredFrag, {shaders::gl_test::kSharedValue}}},
            {{"BASE", "10.0"}});
        const GlTexture texture(context, GL_TEXTURE_3D, GL_R32F, kWidth, kHeight, kLayers);
        GlFramebuffer framebuffer(context);
        framebuffer.attach(GL_COLOR_ATTACHMENT0, texture);
        const GlVertexArray empty(context);
        gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
        gl.Viewport(0, 0, kWidth, kHeight);
        gl.UseProgram(program.id());
        gl.BindVertexArray(empty.id());
        gl.DrawArraysInstanced(GL_TRIANGLES, 0, 3, kLayers);
        return readTexture(context, texture, kWidth * kHeight * kLayers);
    });
    std::size_t i = 0;
    for (int z = 0; z < kLayers; ++z)
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x)
                ASSERT_EQ(values[i++], 10.0f + float(z) + float(x) / 16 + float(y) / 256);
}

TEST_P(Gl, AnErrorOfOpenGlBecomesAGlError) {
    GlThread thread(GetParam(), {.debug = true});
    const std::string message =
        messageOf([&] { thread.run([](GlContext& context) { context.functions().Enable(0x1234); }); });
    const std::string ours = "OpenGL failed: GL_INVALID_ENUM";
    EXPECT_EQ(message.substr(0, ours.size()), ours);
    EXPECT_GT(message.size(), ours.size() + 5) << "the driver's own words, whatever they are, are missing";
    EXPECT_EQ(thread.run([](GlContext&) { return 7; }), 7) << "the failure must not stick to the thread";
}

TEST_P(Gl, AnExceptionOfATaskReachesItsCaller) {
    GlThread thread(GetParam());
    EXPECT_THROW(thread.run([](GlContext& context) {
        context.functions().Enable(0x1234);
        throw InputError("mine");
    }),
                 InputError);
    EXPECT_NO_THROW(thread.run([](GlContext&) {}));
    std::future<int> failing = thread.post([](GlContext&) -> int { throw InputError("mine"); });
    EXPECT_THROW(failing.get(), InputError);
}

TEST_P(Gl, ATaskStartsFromDefaultState) {
    GlThread thread(GetParam());
    thread.run([](GlContext& context) {
        context.functions().Enable(GL_BLEND);
        context.functions().ColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
        context.functions().DepthFunc(GL_GREATER);
    });
    thread.run([](GlContext& context) {
        EXPECT_FALSE(context.functions().IsEnabled(GL_BLEND));
        GLint depthFunction = 0;
        context.functions().GetIntegerv(GL_DEPTH_FUNC, &depthFunction);
        EXPECT_EQ(depthFunction, GL_LESS);
    });
}

TEST_P(Gl, TasksRunInOrderAndAreDrainedAtTheEnd) {
    std::vector<int> order;
    {
        GlThread thread(GetParam());
        for (int i = 0; i < 100; ++i) thread.post([&order, i](GlContext&) { order.push_back(i); });
    }
    std::vector<int> expected(100);
    std::iota(expected.begin(), expected.end(), 0);
    EXPECT_EQ(order, expected);
}

TEST_P(Gl, CallersOnManyThreadsShareOneContext) {
    GlThread thread(GetParam());
    std::vector<std::thread> callers;
    std::array<int, 8> sums{};
    for (std::size_t c = 0; c < sums.size(); ++c)
        callers.emplace_back([&thread, &sum = sums[c]] {
            for (int i = 0; i < 50; ++i)
                sum += thread.run([&](GlContext& context) {
                    const std::array<int, 1> source{i};
                    const GlBuffer buffer(context, std::span(source));
                    int value = 0;
                    context.functions().GetNamedBufferSubData(buffer.id(), 0, sizeof value, &value);
                    return value;
                });
        });
    for (std::thread& caller : callers) caller.join();
    for (const int sum : sums) EXPECT_EQ(sum, 49 * 50 / 2);
}

TEST_P(Gl, ACompileErrorNamesShaderAndLine) {
    GlThread thread(GetParam());
    const ShaderText common{"common.glsl", "float twice(float x) { return 2 * x; }\n"};
    const ShaderText broken{"broken.frag.glsl",
                            "#version 450 core\nout float v;\nvoid main() {\n    v = nowhere;\n}\n"};
    const std::string message = messageOf([&] {
        thread.run([&](GlContext& context) {
            makeProgram(context, {{GL_FRAGMENT_SHADER, broken, {common}}}, {{"A", "1"}, {"B", "2"}});
        });
    });
    EXPECT_NE(message.find("broken.frag.glsl, line 4"), std::string::npos) << message;
    EXPECT_NE(message.find("nowhere"), std::string::npos) << message;
    const ShaderText brokenCommon{"common.glsl", "\n\nfloat twice(float x) { return twoTimes * x; }\n"};
    const ShaderText fine{"fine.frag.glsl", "out float v;\nvoid main() { v = twice(1); }\n"};
    const std::string other = messageOf([&] {
        thread.run([&](GlContext& context) {
            makeProgram(context, {{GL_FRAGMENT_SHADER, fine, {brokenCommon}}});
        });
    });
    EXPECT_NE(other.find("common.glsl, line 3"), std::string::npos) << other;
}

TEST_P(Gl, ALinkErrorNamesTheShaders) {
    GlThread thread(GetParam());
    const ShaderText vertex{"a.vert.glsl", "void main() { gl_Position = vec4(0); }\n"};
    const ShaderText fragment{"b.frag.glsl", "in float lost;\nout float v;\nvoid main() { v = lost; }\n"};
    const std::string message = messageOf([&] {
        thread.run([&](GlContext& context) {
            makeProgram(context, {{GL_VERTEX_SHADER, vertex}, {GL_FRAGMENT_SHADER, fragment}});
        });
    });
    EXPECT_NE(message.find("a.vert.glsl, b.frag.glsl"), std::string::npos) << message;
    EXPECT_NE(message.find("lost"), std::string::npos) << message;
}

TEST_P(Gl, LiveObjectsReturnToZero) {
    GlThread thread(GetParam());
    const auto live = [&] { return thread.run([](GlContext& context) { return context.liveObjects(); }); };
    EXPECT_EQ(live(), 0);
    GlBuffer kept = thread.run([&](GlContext& context) {
        GlBuffer buffer(context, 64, GL_DYNAMIC_STORAGE_BIT);
        const GlTexture view(context, GL_R32F, buffer);
        const GlTexture texture(context, GL_TEXTURE_2D_ARRAY, GL_R8, 4, 4, 4);
        const GlFramebuffer framebuffer(context);
        const GlVertexArray array(context);
        const GlQuery query(context, GL_TIME_ELAPSED);
        const GlFence fence(context);
        const GlProgram program = makeProgram(context, {{GL_VERTEX_SHADER, {"v", "void main() {}"}}});
        EXPECT_EQ(context.liveObjects(), 8);
        return buffer;
    });
    EXPECT_EQ(live(), 1);
    thread.run([&](GlContext&) { kept.reset(); });
    EXPECT_EQ(live(), 0);
}

TEST_P(Gl, AHandleDestroyedOnAnotherThreadIsReportedAndFreed) {
    GlThread thread(GetParam());
    {
        const GlBuffer lost = thread.run([](GlContext& context) { return GlBuffer(context, 64, 0); });
    }
    EXPECT_THROW(thread.run([](GlContext&) {}), InternalError);
    EXPECT_EQ(thread.run([](GlContext& context) { return context.liveObjects(); }), 0);
}

TEST_P(Gl, AHandleMayOutliveItsContext) {
    GlBuffer late;
    {
        GlThread thread(GetParam());
        late = thread.run([](GlContext& context) { return GlBuffer(context, 64, 0); });
    }
    EXPECT_TRUE(late);
}

TEST_P(Gl, ATextureBeyondTheLimitIsRefusedWithItsSize) {
    GlThread thread(GetParam());
    const int size = thread.info().limits.texture3dSize + 1;
    const std::string message = messageOf([&] {
        thread.run([&](GlContext& context) { GlTexture(context, GL_TEXTURE_3D, GL_R8, size, 1, 1); });
    });
    EXPECT_NE(message.find(std::to_string(size) + " x 1 x 1"), std::string::npos) << message;
}

TEST_P(Gl, APersistentMapShowsWhatTheDeviceDidBeforeTheFence) {
    GlThread thread(GetParam());
    thread.run([](GlContext& context) {
        constexpr GLbitfield kAccess =
            GL_MAP_READ_BIT | GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
        const GlFunctions& gl = context.functions();
        GlBuffer source(context, 4 * sizeof(int), kAccess), target(context, 4 * sizeof(int), kAccess);
        auto* in = static_cast<volatile int*>(source.map(0, source.bytes(), kAccess));
        const auto* out = static_cast<volatile const int*>(target.map(0, target.bytes(), kAccess));
        for (int round = 1; round <= 3; ++round) {
            for (int i = 0; i < 4; ++i) in[i] = 10 * round + i;
            gl.CopyNamedBufferSubData(source.id(), target.id(), 0, 0, source.bytes());
            const GlFence fence(context);
            fence.wait();
            EXPECT_TRUE(fence.isSignaled());
            for (int i = 0; i < 4; ++i) EXPECT_EQ(out[i], 10 * round + i);
        }
    });
}

// Under a sanitizer a context takes a quarter of a second.
constexpr int kContexts = kIsSanitized ? 10 : 100;

TEST_P(Gl, AContextCanBeMadeAndEndedManyTimes) {
    const auto cycle = [&] {
        GlThread thread(GetParam());
        thread.run([](GlContext& context) {
            const GlTexture texture(context, GL_TEXTURE_3D, GL_R32F, 16, 16, 16);
            GlFramebuffer framebuffer(context);
            framebuffer.attach(GL_COLOR_ATTACHMENT0, texture);
            const float value = 2;
            context.functions().ClearNamedFramebufferfv(framebuffer.id(), GL_COLOR, 0, &value);
            ASSERT_EQ(readTexture(context, texture, 16 * 16 * 16).back(), 2.0f);
        });
    };
    for (int i = 0; i < std::min(10, kContexts / 2); ++i) cycle();  // what the driver sets up once
    const std::int64_t before = residentBytes();
    for (int i = 0; i < kContexts; ++i) cycle();
    const std::int64_t grownBytes = residentBytes() - before;
    RecordProperty("grown_bytes", std::to_string(grownBytes));
    // The address sanitizer keeps freed memory in quarantine.
    constexpr std::int64_t kBoundBytes = kIsAddressSanitized ? 100'000'000 : 4'000'000;
    EXPECT_LT(grownBytes, kBoundBytes) << "a context must give its memory back";
}

/// Fills textures with values of its own and counts texels that differ.
std::int64_t fillAndCompare(GlThread& thread, float offset) {
    std::int64_t wrong = 0;
    for (int round = 0; round < 50; ++round)
        wrong += thread.run([&](GlContext& context) {
            const GlTexture texture(context, GL_TEXTURE_3D, GL_R32F, 16, 16, 16);
            GlFramebuffer framebuffer(context);
            framebuffer.attach(GL_COLOR_ATTACHMENT0, texture);
            const float value = offset + float(round);
            context.functions().ClearNamedFramebufferfv(framebuffer.id(), GL_COLOR, 0, &value);
            const std::vector<float> read = readTexture(context, texture, 16 * 16 * 16);
            return std::count_if(read.begin(), read.end(), [&](float v) { return v != value; });
        });
    return wrong;
}

/// Two contexts, each on its own thread and used from its own caller, at the same time.
void useTogether(GlPlatform first, GlPlatform second) {
    GlThread one(first), other(second);
    std::future<std::int64_t> wrong =
        std::async(std::launch::async, [&] { return fillAndCompare(one, 0.5f); });
    EXPECT_EQ(fillAndCompare(other, 1000.25f), 0);
    EXPECT_EQ(wrong.get(), 0);
}

TEST_P(Gl, TwoContextsWorkAtOnce) {
    useTogether(GetParam(), GetParam());
}

TEST_P(Gl, TheSharedThreadIsOneForThePlatform) {
    GlThread& thread = sharedGlThread(GetParam());
    EXPECT_EQ(thread.platform(), GetParam());
    EXPECT_EQ(&thread, &sharedGlThread(GetParam()));
    EXPECT_EQ(fillAndCompare(thread, 3), 0);
}

TEST_P(Gl, ATaskInsideATaskRunsAtOnce) {
    GlThread thread(GetParam());
    EXPECT_EQ(thread.run([&](GlContext&) { return 1 + thread.run([](GlContext&) { return 2; }); }), 3);
}

TEST(GlPlatforms, EglAndOsmesaWorkAtOnce) {
    TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless);
    TESSERA_NEEDS_GL(GlPlatform::osmesa);
    useTogether(GlPlatform::eglSurfaceless, GlPlatform::osmesa);
}

TEST(GlPlatforms, NamesReadBackAndUnknownOnesAreRefused) {
    for (const GlPlatform platform : glPlatforms()) EXPECT_EQ(parseGlPlatform(nameOf(platform)), platform);
    EXPECT_THROW(parseGlPlatform("glx"), InputError);
}

TEST(GlPlatforms, TheChoiceIsTheFirstAvailableAndSoftwareDevicesComeLast) {
    const std::vector<GlPlatform>& available = availableGlPlatforms();
    for (const GlPlatform platform : glPlatforms()) {
        const bool isListed = std::find(available.begin(), available.end(), platform) != available.end();
        EXPECT_EQ(isListed, unavailableReason(platform).empty()) << nameOf(platform);
        if (!isListed) {
            EXPECT_THROW(chooseGlPlatform(platform), GlError);
        }
    }
    if (available.empty()) {
        EXPECT_THROW(chooseGlPlatform(), GlError);
        return;
    }
    EXPECT_EQ(chooseGlPlatform(), available.front());
    if (available.size() > 1 && available.front() == GlPlatform::eglDevice) {
        EXPECT_FALSE(glDeviceInfo(GlPlatform::eglDevice).isSoftware);
    }
}

TEST(GlPlatforms, ReasonsMayBeAskedFromManyThreads) {
    std::vector<std::thread> callers;
    for (int i = 0; i < 8; ++i)
        callers.emplace_back([] {
            for (const GlPlatform platform : glPlatforms())
                if (unavailableReason(platform).empty()) {
                    EXPECT_EQ(glDeviceInfo(platform).platform, platform);
                }
        });
    for (std::thread& caller : callers) caller.join();
}

INSTANTIATE_TEST_SUITE_P(Platform, Gl, testing::ValuesIn(glPlatforms()),
                         [](const auto& test) { return testNameOf(test.param); });

}  // namespace
}  // namespace tessera
