// How far sampling is from what this machine's memory allows. Measures fill, copy and first-touch bandwidth
// and pure arithmetic, then samples uniform lattices in warm runs with one thread and with all: each stage's
// time, how many times over the time that the fewest bytes need it is (the mesh read once, values and
// coverage written once), and how much all threads win of one. roofline mesh.vtu [--points 64,128,256,512]
// [--runs 7]
// [--threads 2] [--csv bench/results/roofline.csv]

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <new>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include <sys/mman.h>

#include "arguments.h"
#include "base/timer.h"
#include "bench_statistics.h"
#include "mesh_files/read_mesh.h"
#include "resample/statistic_names.h"
#include "tessera/registry.h"
#include "uniform_run.h"

namespace {

using tessera::bench::medianOf;

struct Options {
    std::string meshPath, csvPath;
    std::vector<int> sizes{64, 128, 256, 512};
    int runs = 7, threads = 2;
};

constexpr std::size_t kProbeBytes = std::size_t(256) << 20;

double identity(double ms) {
    return ms;
}

/// Milliseconds until each of the threads has done its share of [0, count).
double timeShares(int threads, std::size_t count, const std::function<void(std::size_t, std::size_t)>& work) {
    const tessera::Timer timer;
    std::vector<std::thread> others;
    const std::size_t share = count / std::size_t(threads);
    for (int t = 1; t < threads; ++t) others.emplace_back(work, std::size_t(t) * share, share);
    work(0, share);
    for (std::thread& other : others) other.join();
    return timer.elapsedMs();
}

/// Steps of eight chains that need no memory.
void compute(std::size_t steps) {
    std::array<double, 8> x{1, 2, 3, 4, 5, 6, 7, 8};
    for (std::size_t i = 0; i < steps; ++i)
        for (double& value : x) value = value * 0.999999 + 1e-7;
    if (std::accumulate(x.begin(), x.end(), 0.0) < 0) std::abort();  // never: the sum is wanted
}

/// Fresh pages of the system's.
class Pages {
  public:
    explicit Pages(bool large)
        : data_(static_cast<char*>(
              ::mmap(nullptr, kProbeBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0))) {
        if (data_ == MAP_FAILED) throw std::bad_alloc();
        ::madvise(data_, kProbeBytes, large ? MADV_HUGEPAGE : MADV_NOHUGEPAGE);
    }
    ~Pages() { ::munmap(data_, kProbeBytes); }
    Pages(const Pages&) = delete;
    Pages& operator=(const Pages&) = delete;
    char* data() { return data_; }

  private:
    char* data_;
};

/// What the machine does, GB/s and steps a millisecond.
struct Machine {
    double fill = 0, copy = 0, touchSmall = 0, touchLarge = 0, arithmetic = 0;
};

Machine measureMachine(int threads, int runs) {
    std::array<std::vector<double>, 5> ms;
    constexpr std::size_t kSteps = 40'000'000;
    Pages from(true), to(true);
    std::memset(from.data(), 1, kProbeBytes);
    std::memset(to.data(), 1, kProbeBytes);
    for (int run = 0; run < runs; ++run) {
        ms[0].push_back(timeShares(threads, kProbeBytes, [&](std::size_t at, std::size_t n) {
            std::memset(to.data() + at, run, n);
        }));
        ms[1].push_back(timeShares(threads, kProbeBytes, [&](std::size_t at, std::size_t n) {
            std::memcpy(to.data() + at, from.data() + at, n);
        }));
        for (const bool large : {false, true}) {
            Pages fresh(large);
            ms[large ? 3 : 2].push_back(timeShares(threads, kProbeBytes, [&](std::size_t at, std::size_t n) {
                std::memset(fresh.data() + at, run, n);
            }));
        }
        ms[4].push_back(timeShares(threads, kSteps, [](std::size_t, std::size_t n) { compute(n); }));
    }
    const auto rate = [&](int probe) {
        return double(kProbeBytes) / 1e6 / medianOf(ms[std::size_t(probe)], identity);
    };
    return {rate(0), 2 * rate(1), rate(2), rate(3), double(kSteps) / medianOf(ms[4], identity)};
}

void printMachine(int threads, const Machine& m) {
    fmt::print(
        "{} threads: fill {:.1f} GB/s, copy {:.1f} GB/s read and written, first touch {:.1f} GB/s (large "
        "pages {:.1f})\n",
        threads, m.fill, m.copy, m.touchSmall, m.touchLarge);
}

struct Run {
    double plan = 0, bin = 0, sample = 0, store = 0, report = 0;
    std::int64_t voxels = 0;

    double withoutReport() const { return plan + bin + sample + store; }
    double all() const { return withoutReport() + report; }
};

Run runOnce(const tessera::TetMesh& mesh, const std::vector<int>& fields, int points, int threads) {
    const tessera::BrickResult result =
        tessera::bench::runUniform(mesh, fields, tessera::findResampler("software"), points, threads);
    Run run;
    run.plan = result.times.planMs;
    run.bin = result.statistics.ms(tessera::stage::bin);
    run.sample = result.statistics.ms(tessera::stage::sample);
    run.store = result.times.resampleMs - run.bin - run.sample;
    run.report = result.times.verifyMs;
    run.voxels = result.store.coveredPoints();
    return run;
}

/// The mesh read once, values and coverage of the covered points written once.
double leastMs(const tessera::TetMesh& mesh, const std::vector<int>& fields, std::int64_t voxels,
               const Machine& machine) {
    double read = double(mesh.tets.size() * sizeof mesh.tets[0] + mesh.points.size() * sizeof mesh.points[0]);
    int channels = 0;
    for (const int f : fields) {
        const tessera::Field& field = mesh.fields[std::size_t(f)];
        read += double(field.values.size()) * sizeof(double);
        channels += field.components;
    }
    const double written = double(voxels) * (channels * 4.0 + 1.0 / 8);
    return read / 1e6 / machine.copy + written / 1e6 / machine.fill;
}

std::string row(int points, int threads, double least, const std::vector<Run>& runs, double ofOneMs,
                double arithmeticGain) {
    const auto figure = [&](auto of) { return medianOf(runs, of); };
    const double bare = figure([](const Run& r) { return r.withoutReport(); });
    const double all = figure([](const Run& r) { return r.all(); });
    const std::array<double, 5> stages{
        figure([](const Run& r) { return r.plan; }), figure([](const Run& r) { return r.bin; }),
        figure([](const Run& r) { return r.sample; }), figure([](const Run& r) { return r.store; }),
        figure([](const Run& r) { return r.report; })};
    std::string line = fmt::format("{:>5}^3 {:>7} {:>7.2f}", points, threads, least);
    std::string csv = fmt::format("{},{},{},{:.3f}", points, threads, runs[0].voxels, least);
    for (const double ms : stages) {
        line += fmt::format(" {:>8.1f} ({:>5.1f})", ms, ms / least);
        csv += fmt::format(",{:.2f}", ms);
    }
    line += fmt::format(" {:>8.1f} ({:>5.1f}) {:>8.1f}", bare, bare / least, all);
    csv += fmt::format(",{:.2f},{:.2f}", bare, all);
    if (ofOneMs > 0)
        line += fmt::format("   {:.2f} of one thread's speed, {:.2f} of arithmetic's gain", ofOneMs / bare,
                            ofOneMs / bare / arithmeticGain);
    fmt::print("{}\n", line);
    std::fflush(stdout);
    return csv + "\n";
}

void measure(const Options& options) {
    const tessera::MeshFile file = tessera::readMesh(options.meshPath, {}, {});
    const std::vector<int> fields = tessera::everyField(file.mesh);
    std::vector<int> threadCounts{1};
    if (options.threads > 1) threadCounts.push_back(options.threads);
    std::vector<Machine> machines;
    for (const int threads : threadCounts) {
        machines.push_back(measureMachine(threads, std::min(options.runs, 7)));
        printMachine(threads, machines.back());
    }
    const double gain = machines.back().arithmetic / machines.front().arithmetic;
    fmt::print("arithmetic: {:.2f} of one thread's speed\n\n", gain);
    fmt::print(
        "{} elements, median of {} interleaved warm runs, milliseconds; in brackets times the least, which "
        "the fewest bytes need\n",
        file.mesh.elementCount(), options.runs);
    fmt::print("{:>7} {:>7} {:>7} {:>16} {:>16} {:>16} {:>16} {:>16} {:>16} {:>8}\n", "points", "threads",
               "least", "plan", "bin", "sample", "store", "report", "without report", "all");
    std::string csv =
        "points,threads,covered,least_ms,plan_ms,bin_ms,sample_ms,store_ms,report_ms,without_report_ms,all_"
        "ms\n";
    for (const int points : options.sizes) {
        std::vector<std::vector<Run>> runs(threadCounts.size());
        runOnce(file.mesh, fields, points, threadCounts.back());
        for (int r = 0; r < options.runs; ++r)
            for (std::size_t t = 0; t < threadCounts.size(); ++t)
                runs[t].push_back(runOnce(file.mesh, fields, points, threadCounts[t]));
        const double ofOne = medianOf(runs[0], [](const Run& run) { return run.withoutReport(); });
        for (std::size_t t = 0; t < threadCounts.size(); ++t)
            csv += row(points, threadCounts[t], leastMs(file.mesh, fields, runs[t][0].voxels, machines[t]),
                       runs[t], t == 0 ? 0 : ofOne, gain);
    }
    tessera::bench::writeText(options.csvPath, csv);
}

}  // namespace

int main(int count, char** words) {
    Options options;
    tessera::bench::Arguments arguments("How far sampling is from what the memory allows.");
    arguments.addNeeded("mesh", options.meshPath, "a .vtu file, e.g. that of make_graded_mesh.py");
    arguments.add("--csv", options.csvPath, "also write the figures here");
    arguments.add("--points", options.sizes, "lattice points along an axis");
    arguments.add("--runs", options.runs, "", {1, 1000});
    arguments.add("--threads", options.threads, "", {1, 1024});
    return arguments.run(count, words, [&] {
        measure(options);
        return 0;
    });
}
