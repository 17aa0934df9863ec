#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>

#include "base/machine_memory.h"
#include "files/atomic_file.h"
#include "job/cut_mesh.h"
#include "job/describe_files.h"
#include "job/focus_path.h"
#include "job/focus_trace.h"
#include "job/memory_plan.h"
#include "job/resample_files.h"
#include "job/verify_file.h"
#include "registry/kept_costs.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

const std::string kMesh = std::string(TESSERA_DATA_DIR) + "/ccx-cavity/cavity.vtu";

/// A job without a terminal: what it tells is kept.
class JobTest : public testing::Test {
  protected:
    JobTest() : folder_(fs::path(testing::TempDir()) / ("job_test_" + std::to_string(::getpid()))) {
        fs::create_directories(folder_);
        ::setenv("XDG_CACHE_HOME", folder_.c_str(), 1);
        job.say = [this](const std::string& text) { said += text; };
        job.warn = [this](const std::string& text) { warnings.push_back(text); };
        job.fellShort = [this](const std::string& text) { shortfalls.push_back(text); };
    }
    ~JobTest() override { fs::remove_all(folder_); }

    ResampleRequest request() const {
        ResampleRequest request;
        request.inputs = {kMesh};
        request.output = file("out.vdb");
        request.format = &outputFormats().front();
        request.refine.criterion = Criterion::uniform;
        request.refine.resolution = 16;
        request.write.criterion = "uniform";
        return request;
    }
    std::string file(const std::string& name) const { return (folder_ / name).string(); }

    Job job;
    std::string said;
    std::vector<std::string> shortfalls, warnings;

  private:
    fs::path folder_;
};

/// One on a device that is lost at the first box that it samples.
class LostDevice : public Resampler {
  public:
    LostDevice() : Resampler({.name = "lost-device", .description = "for tests", .isOnDevice = true}) {}
    std::unique_ptr<BoundResampler> bind(const TetMesh&, std::span<const int>,
                                         const BindOptions&) const override {
        return std::make_unique<Bound>();
    }

  private:
    struct Bound : BoundResampler {
        ResampleStatistics resample(const Lattice&, std::span<const IndexBox>, const BlockSink&,
                                    const Execution&) override {
            throw GlError("OpenGL failed: the device was lost");
        }
    };
};

void addLostDevice() {
    static const bool added = (registerResampler(std::make_unique<LostDevice>()), true);
    EXPECT_TRUE(added);
    // For "auto" it is the quickest.
    const Resampler& lost = findResampler("lost-device");
    keepCosts(costsPath(), {{costKey(lost, {}, {}), {1e-9, 0, 0, 0}}});
}

constexpr const char* kGoesOn =
    "lost-device failed here (OpenGL failed: the device was lost), so auto goes on with software";

TEST_F(JobTest, aLostDeviceIsAnErrorWhereItWasAskedFor) {
    addLostDevice();
    ResampleRequest request = this->request();
    request.algorithm = "lost-device";
    EXPECT_THROW(resampleFiles(request, job), GlError);
    EXPECT_FALSE(fs::exists(request.output));
    EXPECT_TRUE(warnings.empty());
}

TEST_F(JobTest, autoGoesOnWithSoftwareWhenADeviceIsLost) {
    addLostDevice();
    ResampleRequest request = this->request();
    const Json expected = resampleFiles(request, job);
    request.algorithm = "auto";
    const Json document = resampleFiles(request, job);
    EXPECT_EQ(warnings, std::vector<std::string>{kGoesOn});
    EXPECT_EQ(document["algorithm"], "software");
    EXPECT_EQ(document["algorithm_reason"], kGoesOn);
    EXPECT_EQ(document["error"], expected["error"]);
    EXPECT_TRUE(verifyFile({kMesh, request.output}, job).holds());
}

TEST_F(JobTest, cutsAndTracesGoOnWithSoftwareWhenADeviceIsLost) {
    addLostDevice();
    CutRequest cut;
    cut.input = kMesh;
    cut.output = file("cut.png");
    cut.cut.resolution = 32;
    cut.algorithm = "auto";
    EXPECT_EQ(cutMesh(cut, job).algorithm, "software");
    std::ofstream(file("path.txt")) << "50 50 50\n60 50 50\n";
    FocusTraceRequest trace;
    trace.input = kMesh;
    trace.path = file("path.txt");
    trace.radiusWorld = 20;
    trace.resolution = 32;
    trace.algorithm = "auto";
    const FocusTrace traced = traceFocus(trace, job);
    EXPECT_EQ(traced.algorithm, "software");
    EXPECT_EQ(traced.steps.size(), 2u);
    EXPECT_EQ(warnings, (std::vector<std::string>{kGoesOn, kGoesOn}));
}

TEST_F(JobTest, writesAFileThatVerifies) {
    const ResampleRequest request = this->request();
    const Json document = resampleFiles(request, job);
    EXPECT_EQ(document["output"], request.output);
    EXPECT_EQ(document["write"]["file_bytes"], fs::file_size(request.output));
    EXPECT_NE(said.find(request.output), std::string::npos);
    EXPECT_TRUE(shortfalls.empty());
    const Verification verification = verifyFile({kMesh, request.output}, job);
    EXPECT_TRUE(verification.holds());
    EXPECT_EQ(verification.voxels.samples.covered, document["voxels"]["covered_total"]);
}

TEST_F(JobTest, tellsWhatFellShort) {
    ResampleRequest request = this->request();
    request.dryRun = true;
    request.refine = {};
    request.refine.criterion = Criterion::error;
    request.refine.maxError = 1e-5;
    request.refine.maxVoxels = 400000;
    const Json document = resampleFiles(request, job);
    ASSERT_EQ(shortfalls.size(), 1u);
    EXPECT_NE(shortfalls[0].find("not within the bound"), std::string::npos);
    EXPECT_TRUE(document["output"].is_null());
    EXPECT_FALSE(fs::exists(request.output));
}

TEST_F(JobTest, leavesNothingWhenItIsCancelled) {
    const std::atomic<bool> stop = true;
    job.execution.cancel = &stop;
    EXPECT_THROW(resampleFiles(request(), job), Cancelled);
    EXPECT_FALSE(fs::exists(request().output));
}

TEST_F(JobTest, writesNothingWhereItsDocumentWillStand) {
    job.reportPath = request().output;
    EXPECT_THROW(resampleFiles(request(), job), InputError);
}

TEST_F(JobTest, tablesKeepToTheirWidth) {
    job.textWidth = 44;
    describeFiles({{kMesh}, -1, {}, false}, job);
    std::istringstream lines(said.substr(said.find("  field")));
    std::size_t count = 0;
    for (std::string line; std::getline(lines, line); ++count) EXPECT_LE(line.size(), 44u) << line;
    EXPECT_GT(count, 2u);
}

TEST_F(JobTest, aFocusPathIsAPlaceALine) {
    writeFileAtomically(file("path.txt"), "# places\n1 2 3\n\n \t-1e2,0.5 , .25\t# here\r\n0 -0 1e-300");
    const std::vector<Vec3d> expected{{1, 2, 3}, {-100, 0.5, 0.25}, {0, 0, 1e-300}};
    EXPECT_EQ(readFocusPath(file("path.txt")), expected);
}

TEST_F(JobTest, aBadLineOfAFocusPathIsNamed) {
    for (const std::string bad : {"1 2", "1 2 3 4", "1 2 x", "1,,2,3", ",1 2 3", "1 2 3,", "nan 0 0",
                                  "0 inf 0", "1e999 0 0", "1;2;3", "1-2 3 4", "1 2 3x"}) {
        writeFileAtomically(file("path.txt"), "0 0 0\n" + bad + "\n1 1 1\n");
        try {
            readFocusPath(file("path.txt"));
            ADD_FAILURE() << bad;
        } catch (const InputError& error) {
            const std::string text = error.what();
            EXPECT_NE(text.find("path.txt, line 2: expected"), std::string::npos) << text;
            EXPECT_NE(text.find("'" + bad + "'"), std::string::npos) << text;
        }
    }
    writeFileAtomically(file("path.txt"), "\n# nothing\n");
    EXPECT_THROW(readFocusPath(file("path.txt")), InputError);
    EXPECT_THROW(readFocusPath(file("other.txt")), InputError);
}

TEST_F(JobTest, aFocusTraceThatIsCancelledLeavesNothing) {
    writeFileAtomically(file("path.txt"), "50 50 50");
    FocusTraceRequest trace;
    trace.input = kMesh;
    trace.path = file("path.txt");
    trace.output = file("trace.csv");
    trace.radiusWorld = 1;
    const std::atomic<bool> stop = true;
    job.execution.cancel = &stop;
    EXPECT_THROW(traceFocus(trace, job), Cancelled);
    EXPECT_FALSE(fs::exists(trace.output));
}

TEST(MemoryPlan, WhatIsSharedOutStaysWithinTheBound) {
    const TetMesh mesh;
    for (const Resampler* resampler : resamplers())
        for (const int channels : {1, 9}) {
            const WorkMemory work = resampler->workMemory(channels);
            for (const bool isFlat : {false, true})
                for (const std::int64_t bound : {std::int64_t(400) << 20, std::int64_t(64) << 30}) {
                    const MemoryShares shares = shareMemory(bound, mesh, isFlat, work);
                    EXPECT_GT(shares.levelsBytes, 0);
                    EXPECT_GE(shares.workBytes, work.least);
                    EXPECT_LE(shares.workBytes, work.most);
                    EXPECT_LT(
                        work.fixed + shares.workBytes + shares.levelsBytes + (isFlat ? shares.flatBytes : 0),
                        bound);
                }
        }
}

TEST(MemoryPlan, ARefusalSaysWhatIsEnough) {
    const TetMesh mesh;
    const WorkMemory work{50 << 20, 20 << 20, 900 << 20};
    try {
        shareMemory(100 << 20, mesh, false, work);
        FAIL();
    } catch (const InputError& error) {
        const std::string text = error.what();
        const std::string option = "--max-memory ";
        ASSERT_NE(text.rfind(option), std::string::npos) << text;
        const std::int64_t enough = std::stoll(text.substr(text.rfind(option) + option.size()));
        EXPECT_NO_THROW(shareMemory(enough << 20, mesh, false, work));
        EXPECT_THROW(shareMemory((enough - 30) << 20, mesh, false, work), InputError);
    }
}

TEST(MemoryPlan, WithoutABoundTheMemoryHereDecides) {
    const TetMesh mesh;
    const WorkMemory work{0, 1 << 20, 1 << 20};
    EXPECT_EQ(shareMemory(0, mesh, false, work).levelsBytes,
              shareMemory(defaultMemoryBytes(), mesh, false, work).levelsBytes);
    try {
        shareMemory(0, mesh, false, {defaultMemoryBytes(), 1 << 20, 1 << 20});
        FAIL();
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("without --max-memory"), std::string::npos);
    }
}

}  // namespace
}  // namespace tessera
