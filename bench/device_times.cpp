// Times every algorithm on the device that there is, against the processor in the same run: device_times
// [meshes] [--elements 100000,1000000] [--points 64,128,256] [--runs 5] [--threads 0] [--target egl-device]
// [--json times.json]. A table for each mesh: binding; samples into blocks; samples that stay on the device;
// a batch of small bricks that stay there. Medians of interleaved runs, in milliseconds.

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "arguments.h"
#include "base/timer.h"
#include "bench_statistics.h"
#include "device/device_samples.h"
#include "gl/gl_platform.h"
#include "benchmark/graded_box.h"
#include "job/algorithm_list.h"
#include "mesh_files/read_mesh.h"
#include "resample/statistic_names.h"

namespace {

using namespace tessera;
using nlohmann::json;

struct Options {
    std::vector<std::string> meshPaths;
    std::vector<int> elements{100000, 1000000}, points{64, 128, 256};
    std::string algorithms = "software,compute,hybrid,hybrid:processor,slicing,slicing:processor";
    std::string target, jsonPath;
    int runs = 5, threads = 0;
};

/// What one way of sampling took.
struct Times {
    double wallMs = 0;
    double renderMs = 0;     ///< on the device, by timer queries
    double processorMs = 0;  ///< of the calling thread and OpenGL's; those that they start apart
    std::int64_t uploadBytes = 0, readBackBytes = 0;
};

template <class Work>
Times timed(GlThread& thread, Work work) {
    const auto processor = [&] {
        return tessera::bench::processorMs(RUSAGE_THREAD) +
               thread.run([](GlContext&) { return tessera::bench::processorMs(RUSAGE_THREAD); });
    };
    Times times;
    const double before = processor();
    const Timer timer;
    const ResampleStatistics statistics = work();
    times.wallMs = timer.elapsedMs();
    times.processorMs = processor() - before;
    times.renderMs = statistics.ms(stage::render);
    times.uploadBytes = statistics.count(counted::uploadBytes);
    times.readBackBytes = statistics.count(counted::readBackBytes);
    return times;
}

json median(const std::vector<Times>& all) {
    const auto of = [&](auto member) {
        return tessera::bench::medianOf(all, [&](const Times& t) { return double(t.*member); });
    };
    return {{"wall_ms", of(&Times::wallMs)},
            {"render_ms", of(&Times::renderMs)},
            {"processor_ms", of(&Times::processorMs)},
            {"upload_bytes", of(&Times::uploadBytes)},
            {"read_back_bytes", of(&Times::readBackBytes)}};
}

/// `points` along the longest edge of the mesh's bounds.
Lattice latticeOf(const TetMesh& mesh, int points) {
    const Box3d bounds = mesh.boundsWorld();
    const Vec3d size = bounds.size();
    return Lattice::axisParallel(bounds.min, std::max({size.x, size.y, size.z}) / (points - 1));
}

/// 4 x 4 x 4 bricks of 16^3 in the middle of 256^3 points.
std::vector<IndexBox> bricksAboutMiddle() {
    std::vector<IndexBox> bricks;
    for (int z = 0; z < 4; ++z)
        for (int y = 0; y < 4; ++y)
            for (int x = 0; x < 4; ++x) {
                const Vec3i corner = Vec3i(96) + 16 * Vec3i(x, y, z);
                bricks.push_back({corner, corner + 16});
            }
    return bricks;
}

json timeMesh(const Options& options, const std::string& name, const TetMesh& mesh, GlThread& thread) {
    fmt::print("\n{}: {} elements\n", name, mesh.elementCount());
    fmt::print("{:<17} {:>10} {:>9} {:>13} {:>13} {:>13} {:>13} {:>11}\n", "algorithm", "points", "bind",
               "into blocks", "on the device", "its shaders", "processor", "uploaded");
    std::vector<int> fields;
    if (!mesh.fields.empty()) fields.push_back(0);
    Execution execution;
    execution.threads = options.threads > 0 ? options.threads : int(std::thread::hardware_concurrency());
    struct Case {
        std::string name;
        Lattice lattice;
        std::vector<IndexBox> boxes;
    };
    std::vector<Case> cases;
    for (const int points : options.points)
        cases.push_back(
            {fmt::format("{}^3", points), latticeOf(mesh, points), {IndexBox{Vec3i(0), Vec3i(points)}}});
    cases.push_back({"64 x 16^3", latticeOf(mesh, 256), bricksAboutMiddle()});
    json rows = json::array();
    for (const Case& one : cases) {
        const auto slots = DeviceSamples::make(thread, one.boxes, codingsOf(mesh, fields, SampleFormat::r32f),
                                               SampleFormat::r32f);
        struct Row {
            std::string algorithm;
            std::unique_ptr<BoundResampler> bound;
            double bindMs;
            std::vector<Times> blocks, device;
        };
        std::vector<Row> all;
        BindOptions bind;
        bind.target = std::string(nameOf(thread.platform()));
        for (const Contestant& c : listAlgorithms(options.algorithms, bind).contestants) {
            const Timer timer;
            all.push_back({c.label, c.resampler->bind(mesh, fields, c.options), 0, {}, {}});
            all.back().bindMs = timer.elapsedMs();
        }
        // The first compiles shaders and puts meshes on the device.
        for (int run = -1; run < options.runs; ++run)
            for (Row& row : all) {
                const BlockSink nobody = [](std::size_t, const Block&) {};
                const Times blocks = timed(
                    thread, [&] { return row.bound->resample(one.lattice, one.boxes, nobody, execution); });
                const Times device = timed(thread, [&] {
                    return row.bound->resampleToDevice(one.lattice, one.boxes, *slots, execution);
                });
                if (run < 0) continue;
                row.blocks.push_back(blocks);
                row.device.push_back(device);
            }
        for (const Row& row : all) {
            const json blocks = median(row.blocks), device = median(row.device);
            fmt::print("{:<17} {:>10} {:>9.1f} {:>13.2f} {:>13.2f} {:>13.2f} {:>13.2f} {:>11.0f}\n",
                       row.algorithm, one.name, row.bindMs, blocks["wall_ms"].get<double>(),
                       device["wall_ms"].get<double>(), device["render_ms"].get<double>(),
                       device["processor_ms"].get<double>(), device["upload_bytes"].get<double>());
            rows.push_back({{"algorithm", row.algorithm},
                            {"points", one.name},
                            {"bind_ms", row.bindMs},
                            {"into_blocks", blocks},
                            {"on_device", device}});
        }
    }
    return {{"mesh", name}, {"elements", mesh.elementCount()}, {"times", rows}};
}

int run(const Options& options) {
    std::optional<GlPlatform> wanted;
    if (!options.target.empty()) wanted = parseGlPlatform(options.target);
    GlThread& thread = sharedGlThread(chooseGlPlatform(wanted));
    const GlDeviceInfo& info = thread.info();
    fmt::print(
        "{} by {}, {}\n{}{}, {} threads of the processor; milliseconds, medians of {} interleaved runs\n",
        info.renderer, info.vendor, info.version, info.platformDetail,
        info.isSoftware ? " (the processor emulates it)" : "",
        options.threads > 0 ? options.threads : int(std::thread::hardware_concurrency()), options.runs);
    json report{{"renderer", info.renderer},   {"vendor", info.vendor},
                {"version", info.version},     {"platform", nameOf(info.platform)},
                {"emulated", info.isSoftware}, {"runs", options.runs},
                {"meshes", json::array()}};
    for (const int elements : options.elements)
        report["meshes"].push_back(
            timeMesh(options, "graded box", tessera::gradedBox(elements), thread));
    for (const std::string& path : options.meshPaths)
        report["meshes"].push_back(timeMesh(options, path, readMesh(path, {}, {}).mesh, thread));
    tessera::bench::writeText(options.jsonPath, report.dump(1) + "\n");
    return 0;
}

}  // namespace

int main(int wordCount, char** words) {
    Options options;
    tessera::bench::Arguments arguments("Times every algorithm on the device that there is.");
    arguments.add("meshes", options.meshPaths, "mesh files");
    arguments.add("--elements", options.elements, "sizes of graded boxes");
    arguments.add("--points", options.points, "lattice points along an axis");
    arguments.add("--algorithms", options.algorithms,
                  "names with commas between them; hybrid:processor: the processor makes primitives");
    arguments.add("--runs", options.runs, "that are timed");
    arguments.add("--threads", options.threads, "of the processor; 0: all");
    arguments.add("--target", options.target, "an OpenGL platform; without, the best one");
    arguments.add("--json", options.jsonPath, "the same as a file");
    return arguments.run(wordCount, words, [&] { return run(options); });
}
