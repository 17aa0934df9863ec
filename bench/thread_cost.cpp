// What the threads that ask for samples do while a device makes them: thread_cost mesh.vtu [--points 256].
// Samples stay on the device, whose own threads do not count. What llvmpipe does on the thread that draws,
// the shading of vertices, does.

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <string>
#include <vector>

#include "arguments.h"
#include "base/timer.h"
#include "bench_statistics.h"
#include "device/device_samples.h"
#include "gl/gl_thread.h"
#include "mesh_files/read_mesh.h"
#include "raster/channel_coding.h"
#include "resample/statistic_names.h"
#include "tessera/registry.h"

namespace {

using namespace tessera;

double threadMs() {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return double(time.tv_sec) * 1e3 + double(time.tv_nsec) * 1e-6;
}

struct Times {
    double wallMs = 0, callerMs = 0, glMs = 0, uploadBytes = 0;
};

}  // namespace

int main(int wordCount, char** words) {
    std::string path;
    int points = 256, runs = 5;
    tessera::bench::Arguments arguments("What the threads that ask a device for samples do themselves.");
    arguments.addNeeded("mesh", path, "a mesh file");
    arguments.add("--points", points, "lattice points along the longest edge of the mesh", {2, 1024});
    arguments.add("--runs", runs, "that are timed", {1, 1000});
    return arguments.run(wordCount, words, [&] {
        const TetMesh mesh = readMesh(path, {}, {}).mesh;
        const std::vector<int> fields{0};
        const Box3d bounds = mesh.boundsWorld();
        const Vec3d size = bounds.size();
        const Lattice lattice =
            Lattice::axisParallel(bounds.min, std::max({size.x, size.y, size.z}) / (points - 1));
        std::vector<IndexBox> bricks;  // 4 x 4 x 4 in the middle
        for (int z = 0; z < 4; ++z)
            for (int y = 0; y < 4; ++y)
                for (int x = 0; x < 4; ++x) {
                    const Vec3i corner = Vec3i(size / (2 * lattice.uWorld.x)) - 32 + 16 * Vec3i(x, y, z);
                    bricks.push_back({corner, corner + 16});
                }
        GlThread& thread = sharedGlThread(chooseGlPlatform({}));
        fmt::print("{:<28}{:>10}{:>16}{:>12}{:>12}\n", "", "ms", "calling thread", "OpenGL's", "uploaded");
        for (const Resampler* resampler : resamplers()) {
            if (!resampler->info().isOnDevice || !resampler->info().meetsContract) continue;
            for (const std::vector<IndexBox>& boxes :
                 {std::vector{IndexBox{Vec3i(0), Vec3i(points)}}, bricks}) {
                const auto slots = DeviceSamples::make(
                    thread, boxes, codingsOf(mesh, fields, SampleFormat::r32f), SampleFormat::r32f);
                BindOptions bind;
                bind.target = std::string(nameOf(thread.platform()));
                bind.route = boxes.size() > 1 ? Route::index : Route::automatic;
                const auto bound = resampler->bind(mesh, fields, bind);
                std::vector<Times> all;
                // The first one compiles shaders and uploads the mesh.
                for (int run = -1; run < runs; ++run) {
                    const auto onGl = [&] { return thread.run([](GlContext&) { return threadMs(); }); };
                    const double gl = onGl(), caller = threadMs();
                    const Timer timer;
                    const ResampleStatistics statistics = bound->resampleToDevice(lattice, boxes, *slots, {});
                    thread.run([](GlContext& context) { context.functions().Finish(); });
                    const Times times{timer.elapsedMs(), threadMs() - caller, onGl() - gl,
                                      double(statistics.count(counted::uploadBytes))};
                    if (run >= 0) all.push_back(times);
                }
                const auto of = [&](auto member) {
                    return tessera::bench::medianOf(all, [&](const Times& t) { return t.*member; });
                };
                fmt::print("{:<28}{:>10.1f}{:>16.2f}{:>12.2f}{:>12.0f}\n",
                           fmt::format("{}, {}", resampler->name(),
                                       boxes.size() > 1 ? "64 bricks of 16^3" : fmt::format("{}^3", points)),
                           of(&Times::wallMs), of(&Times::callerMs), of(&Times::glMs),
                           of(&Times::uploadBytes));
            }
        }
        return 0;
    });
}
