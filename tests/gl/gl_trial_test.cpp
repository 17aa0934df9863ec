#include "gl/gl_trial.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <array>
#include <atomic>
#include <filesystem>

#include "base/timer.h"
#include "gl/gl_platform.h"
#include "gl_test_tools.h"
#include "tessera/error.h"

namespace tessera {
namespace {

constexpr std::array kEgl{GlPlatform::eglDevice, GlPlatform::eglSurfaceless};
constexpr const char* kCrash = "the driver crashed (signal 11, Segmentation fault)";

std::string beside(const char* name) {
    return std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
}

/// Programs that are started from here on find broken drivers of all platforms; this one doesn't.
class GlTrials : public testing::Test {
  protected:
    void SetUp() override {
        for (const GlPlatform platform : {GlPlatform::eglSurfaceless, GlPlatform::osmesa})
            TESSERA_NEEDS_GL(platform);
    }
    void TearDown() override {
        unsetenv("TESSERA_BROKEN_DRIVER");
        unsetenv("LD_LIBRARY_PATH");
    }

    void breakDrivers(const char* way, bool alsoOsmesa = true) {
        std::string folders = beside("broken_driver/egl");
        if (alsoOsmesa) folders += ":" + beside("broken_driver/osmesa");
        setenv("LD_LIBRARY_PATH", folders.c_str(), 1);
        setenv("TESSERA_BROKEN_DRIVER", way, 1);
    }

    /// Long enough for sound drivers on a busy machine.
    GlTrial trial{.executable = beside("gl_trial_program"), .arguments = {}, .seconds = 300};
};

TEST_F(GlTrials, SoundDriversPass) {
    for (const GlTrialResult& result :
         tryGl(trial, std::array{GlPlatform::eglSurfaceless, GlPlatform::osmesa})) {
        EXPECT_EQ(result.reason, "");
        EXPECT_FALSE(result.isFault);
        EXPECT_TRUE(result.found.starts_with(kSoftwareFound) || result.found.starts_with(kHardwareFound))
            << result.found;
        EXPECT_GT(result.found.size(), kSoftwareFound.size());
    }
    breakDrivers("no way");
    EXPECT_EQ(tryGl(trial, std::array{GlPlatform::osmesa})[0].reason, "");
    EXPECT_EQ(tryGl(trial, std::array{GlPlatform::eglSurfaceless})[0].reason, "");
}

TEST_F(GlTrials, ACrashIsAFaultOfItsPlatformAlone) {
    for (const char* way : {"load", "draw"}) {
        breakDrivers(way, false);
        const std::vector<GlTrialResult> results =
            tryGl(trial, std::array{GlPlatform::eglSurfaceless, GlPlatform::osmesa});
        EXPECT_EQ(results[0].reason, kCrash) << way;
        EXPECT_TRUE(results[0].isFault) << way;
        EXPECT_EQ(results[1].reason, "") << way;
        EXPECT_FALSE(results[1].isFault) << way;
        breakDrivers(way);
        EXPECT_EQ(tryGl(trial, std::array{GlPlatform::osmesa})[0].reason, kCrash) << way;
    }
}

TEST_F(GlTrials, ADriverThatEndsTheProcessIsAFault) {
    breakDrivers("exit");
    for (const GlTrialResult& result :
         tryGl(trial, std::array{GlPlatform::eglSurfaceless, GlPlatform::osmesa})) {
        EXPECT_EQ(result.reason, "the driver ended the process that tried it");
        EXPECT_TRUE(result.isFault);
    }
}

TEST_F(GlTrials, AStallEndsAfterTheTimeGiven) {
    breakDrivers("stall");
    trial.seconds = 0.25;
    for (const GlTrialResult& result : tryGl(trial, glPlatforms())) {
        EXPECT_EQ(result.reason, "the driver didn't answer within 0.25 s");
        EXPECT_TRUE(result.isFault);
    }
}

TEST_F(GlTrials, InLittleMemoryOneIsTriedAfterAnother) {
    trial.maxMemoryBytes = 200 << 20;
    for (const GlTrialResult& result : tryGl(trial, glPlatforms())) EXPECT_FALSE(result.isFault);
    breakDrivers("stall");
    trial.seconds = 0.25;
    const Timer timer;
    const std::vector<GlTrialResult> results = tryGl(trial, kEgl);
    EXPECT_EQ(results[0].reason, "the driver didn't answer within 0.25 s");
    EXPECT_EQ(results[1].reason, "the driver didn't answer within 0.25 s");
    EXPECT_GE(timer.elapsedMs(), 500) << "both at once";
}

TEST_F(GlTrials, AStallGivesWayToCancellation) {
    breakDrivers("stall");
    const std::atomic<bool> isCancelled{true};
    trial.cancel = &isCancelled;
    EXPECT_THROW(tryGl(trial, kEgl), Cancelled);
}

TEST_F(GlTrials, WrongTexelsAreNoticed) {
    breakDrivers("nothing");
    const GlTrialResult result = tryGl(trial, std::array{GlPlatform::osmesa})[0];
    EXPECT_EQ(result.reason, "the driver draws something else than it is told to");
    EXPECT_FALSE(result.isFault);
}

TEST_F(GlTrials, WithoutATrialThereIsNoReason) {
    breakDrivers("load");
    trial.arguments = {"deaf"};
    EXPECT_EQ(tryGl(trial, std::array{GlPlatform::osmesa})[0].reason, "");
    trial.executable = beside("no_such_program");
    const GlTrialResult result = tryGl(trial, std::array{GlPlatform::osmesa})[0];
    EXPECT_EQ(result.reason, "can't start the process that tries OpenGL: " + trial.executable +
                                 ": No such file or directory");
    EXPECT_FALSE(result.isFault);
}

TEST(GlTrial, OnlyATesseraProcessStartsIt) {
    const std::vector<std::string> words{"osmesa"};
    EXPECT_THROW(serveGlTrial(words), InputError);
}

}  // namespace
}  // namespace tessera
