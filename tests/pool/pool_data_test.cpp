// Bricks of real meshes, of every field: those bundled with the project, and those of the shared folder where
// it is present.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <random>
#include <tuple>

#include "gl_test_tools.h"
#include "mesh_files/read_mesh.h"
#include "pool/face_steps.h"
#include "schedule/brick_scheduler.h"
#include "schedule/random_schedule.h"
#include "software/software_resampler.h"

namespace tessera {
namespace {

constexpr int kCells = 8;
constexpr GlPlatform kPlatform = GlPlatform::eglSurfaceless;

using OnMesh = std::tuple<std::string, SampleFormat>;

class PoolOfMesh : public testing::TestWithParam<OnMesh> {};

TEST_P(PoolOfMesh, HasNoStepBetweenBricks) {
    TESSERA_NEEDS_GL(kPlatform);
    const auto& [path, format] = GetParam();
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no mesh at " << path;
    const TetMesh mesh = readMesh(path, {}, {}).mesh;
    std::vector<int> fields, channels;
    for (std::size_t f = 0; f < mesh.fields.size(); ++f) {
        fields.push_back(int(f));
        for (int c = 0; c < mesh.fields[f].components; ++c) channels.push_back(int(channels.size()));
    }
    const Vec3d size = mesh.boundsWorld().size();
    const double longest = std::max({size.x, size.y, size.z});

    ScheduleOptions options;
    options.refine.criterion = Criterion::focus;
    options.refine.brickCells = kCells;
    options.refine.resolution = 257;
    options.budgetBytes = 400 * bytesOfBrick(int(channels.size()), kCells);
    std::mt19937 random(unsigned(format) + 11);
    const auto jump = [&] {
        const Vec3d& node = mesh.points[random() % mesh.points.size()];
        return std::vector{pointFocus(node, longest / 16)};
    };
    options.refine.focus = jump();
    const SoftwareResampler resampler;
    GlThread thread(kPlatform);
    TexelCoding coding(codingsOf(mesh, fields, format), format);
    PoolOptions poolOptions;
    poolOptions.budgetBytes = 700 * 9 * 9 * 9 * coding.pointBytes();
    BrickPool pool(thread, kCells, coding, poolOptions);
    PoolTarget target(pool, mesh, fields, 1);
    BrickScheduler scheduler(mesh, fields, resampler, options, target);

    // On the way to a focus and at rest there.
    FaceSteps sum;
    const auto look = [&](int placesALeaf) {
        ASSERT_FALSE(target.isBehind());
        const FaceSteps steps = stepsOnFaces(pool, target, scheduler.tree(), channels, random, placesALeaf);
        sum.texels = std::max(sum.texels, steps.texels);
        sum.values = std::max(sum.values, steps.values);
        sum.places += steps.places;
        sum.acrossDepths += steps.acrossDepths;
    };
    // TESSERA_POOL_JUMPS asks for more.
    const int jumps = asked("TESSERA_POOL_JUMPS", 2);
    for (int i = 0; i < jumps; ++i) {
        scheduler.update(BrickScheduler::Clock::now() + std::chrono::milliseconds(2), {.threads = 1});
        if (scheduler.tree().leafCount() > 0) look(10);
        scheduler.finish({.threads = 1});
        look(25);
        scheduler.setFocus(jump());
    }
    RecordProperty("places", std::to_string(sum.places));
    std::printf(
        "%lld places on faces, %lld between depths, %zu channels: at most %.3f roundings of %s, "
        "%.2g ulp in what was published\n",
        static_cast<long long>(sum.places), static_cast<long long>(sum.acrossDepths), channels.size(),
        sum.texels, std::string(nameOf(format)).c_str(), sum.values);
    EXPECT_LE(sum.texels, 1.0001);
    EXPECT_LE(sum.values, 4);
    EXPECT_GT(sum.acrossDepths, 1000);
}

std::vector<std::string> meshFiles() {
    const std::string bundled = TESSERA_DATA_DIR "/", shared = TESSERA_SHARED_DATA_DIR "/";
    return {bundled + "freefem-stokes-sphere/stokes_p1.vtu", bundled + "ccx-cavity/cavity.vtu",
            bundled + "disk_out_ref/disk_out_ref.vtu", shared + "bluntfin/bluntfin_tets.vtu",
            shared + "ugawg-hemisphere-cylinder/hsc-gmsh-26-adapt.vtu"};
}

INSTANTIATE_TEST_SUITE_P(All, PoolOfMesh,
                         testing::Combine(testing::ValuesIn(meshFiles()),
                                          testing::Values(SampleFormat::r32f, SampleFormat::r16f,
                                                          SampleFormat::r16, SampleFormat::r8)),
                         [](const testing::TestParamInfo<OnMesh>& param) {
                             std::string mesh = std::filesystem::path(std::get<0>(param.param)).stem();
                             std::replace(mesh.begin(), mesh.end(), '-', '_');
                             return mesh + "_" + std::string(nameOf(std::get<1>(param.param)));
                         });

}  // namespace
}  // namespace tessera
