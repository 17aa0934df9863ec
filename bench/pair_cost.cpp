// Time per element-slice pair against the size of the mesh, and what a resample moves through an OpenGL
// device: bytes, vertices, fragments. pair_cost mesh.vtu... [--algorithms slicing,hybrid] [--points 256]
// [--runs 3] [--threads 2] [--csv bench/results/pair_cost.csv]
//
// Two counts of pairs. "pairs" are those that the resampler works at: the slices within an element's box, for
// elements whose box holds a lattice point. "active" are those of the paper's active element list: every
// slice that an element meets, though it may slip between the lattice points of each; culling these is work
// as well. Time per pair, over either count, should not grow with the mesh.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "arguments.h"
#include "base/timer.h"
#include "bench_statistics.h"
#include "mesh_files/read_mesh.h"
#include "resample/statistic_names.h"
#include "tessera/lattice.h"
#include "tessera/registry.h"

namespace {

namespace counted = tessera::counted;
namespace stage = tessera::stage;
using tessera::bench::medianOf;

constexpr int kBlockEdge = 64;

struct Options {
    std::vector<std::string> meshPaths;
    std::vector<std::string> algorithms{"slicing", "hybrid"};
    std::string csvPath;
    int points = 256, runs = 3, threads = 2;
    bool isHashed = false;
};

struct Sample {
    double wallMs = 0, processorMs = 0;
    tessera::ResampleStatistics statistics;
};

/// A cube of points over the mesh's longest axis, as blocks of the size that bricks are sampled in.
struct Task {
    tessera::Lattice lattice;
    std::vector<tessera::IndexBox> boxes;
};

Task makeTask(const tessera::TetMesh& mesh, int points) {
    const tessera::Box3d bounds = mesh.boundsWorld();
    const tessera::Vec3d size = bounds.size();
    const double spacing = std::max({size.x, size.y, size.z}) / (points - 1);
    Task task{tessera::Lattice::axisParallel(bounds.min, spacing), {}};
    const auto all = tessera::IndexBox{{0, 0, 0}, {points, points, points}};
    tessera::Vec3i low;
    for (low.z = 0; low.z < points; low.z += kBlockEdge)
        for (low.y = 0; low.y < points; low.y += kBlockEdge)
            for (low.x = 0; low.x < points; low.x += kBlockEdge)
                task.boxes.push_back(tessera::intersect({low, low + kBlockEdge}, all));
    return task;
}

/// Slices across z that the elements meet.
std::int64_t activePairs(const tessera::TetMesh& mesh, const tessera::Lattice& lattice) {
    std::int64_t pairs = 0;
    for (const auto& tet : mesh.tets) {
        double low = INFINITY, high = -INFINITY;
        for (const std::int32_t node : tet) {
            const double z = (mesh.points[std::size_t(node)].z - lattice.originWorld.z) / lattice.wWorld.z;
            low = std::min(low, z);
            high = std::max(high, z);
        }
        pairs += std::int64_t(std::floor(high)) - std::int64_t(std::ceil(low)) + 1;
    }
    return pairs;
}

Sample runOnce(tessera::BoundResampler& bound, const Task& task, int threads) {
    tessera::Execution execution;
    execution.threads = threads;
    Sample sample;
    const double before = tessera::bench::processorMs();
    const tessera::Timer timer;
    sample.statistics = bound.resample(
        task.lattice, task.boxes, [](std::size_t, const tessera::Block&) {}, execution);
    sample.wallMs = timer.elapsedMs();
    sample.processorMs = tessera::bench::processorMs() - before;
    return sample;
}

/// FNV-1a over all values and coverage, the blocks in their order: shows whether a change kept the bits.
std::uint64_t hashBlocks(tessera::BoundResampler& bound, const Task& task) {
    const auto hashOf = [](const void* bytes, std::size_t count, std::uint64_t hash) {
        for (std::size_t i = 0; i < count; ++i)
            hash = (hash ^ static_cast<const unsigned char*>(bytes)[i]) * 0x100000001b3u;
        return hash;
    };
    std::vector<std::uint64_t> hashes(task.boxes.size());
    bound.resample(task.lattice, task.boxes,
                   [&](std::size_t box, const tessera::Block& block) {
                       const std::uint64_t values = hashOf(
                           block.values.data(), block.values.size() * sizeof(float), 0xcbf29ce484222325u);
                       hashes[box] = hashOf(block.coverage.data(), block.coverage.size(), values);
                   },
                   {});
    return hashOf(hashes.data(), hashes.size() * sizeof(std::uint64_t), 0xcbf29ce484222325u);
}

struct Row {
    std::string algorithm;
    std::int64_t elements = 0, active = 0;
    double wallMs = 0, processorMs = 0;
    tessera::ResampleStatistics statistics;

    double nsPerPair() const { return wallMs * 1e6 / double(statistics.count(counted::elementSlicePairs)); }
    double nsPerActive() const { return wallMs * 1e6 / double(active); }
};

void printPairs(const Row& row, const Row& smallest) {
    const auto growth = [](double now, double first) { return 100 * (now / first - 1); };
    fmt::print(
        "{:>9} {:<8} {:>10} {:>10} {:>10} {:>8.1f} {:>9.1f} {:>8.2f} {:>+7.1f} % {:>9.2f} {:>+7.1f} %\n",
        row.elements, row.algorithm, row.statistics.count(counted::elementSlicePairs), row.active,
        row.statistics.count(counted::polygons), row.wallMs, row.processorMs, row.nsPerPair(),
        growth(row.nsPerPair(), smallest.nsPerPair()), row.nsPerActive(),
        growth(row.nsPerActive(), smallest.nsPerActive()));
    std::fflush(stdout);
}

std::string csvOf(const Options& options, const Row& row) {
    const tessera::ResampleStatistics& s = row.statistics;
    return fmt::format(
        "{},{},{},{},{},{},{},{},{:.1f},{:.1f},{:.2f},{:.2f},{},{},{},{},{:.1f},{:.1f},{:.1f}\n",
        row.elements, row.algorithm, options.points, options.threads, options.runs,
        s.count(counted::elementSlicePairs), row.active, s.count(counted::polygons), row.wallMs,
        row.processorMs, row.nsPerPair(), row.nsPerActive(), s.count(counted::vertices),
        s.count(counted::fragments), s.count(counted::uploadBytes), s.count(counted::readBackBytes),
        s.ms(stage::bin), s.ms(stage::generate), s.ms(stage::render));
}

void printDeviceCost(const std::vector<Row>& rows) {
    fmt::print("\nWhat goes through the device\n{:>9} {:<8} {:>10} {:>10} {:>12} {:>12} {:>12} {:>10}\n",
               "elements", "", "polygons", "vertices", "fragments", "upload, B", "read back, B", "covered");
    for (const Row& row : rows) {
        const tessera::ResampleStatistics& s = row.statistics;
        fmt::print("{:>9} {:<8} {:>10} {:>10} {:>12} {:>12} {:>12} {:>10}\n", row.elements, row.algorithm,
                   s.count(counted::polygons), s.count(counted::vertices), s.count(counted::fragments),
                   s.count(counted::uploadBytes), s.count(counted::readBackBytes),
                   s.count(counted::coveredPoints));
    }
}

/// All algorithms on one mesh, runs interleaved.
std::vector<Row> measureMesh(const Options& options, const std::string& path) {
    const tessera::MeshFile file = tessera::readMesh(path, {}, {});
    const Task task = makeTask(file.mesh, options.points);
    const std::vector<int> fields = file.mesh.fields.empty() ? std::vector<int>{} : std::vector<int>{0};
    std::vector<std::unique_ptr<tessera::BoundResampler>> bound;
    tessera::BindOptions asPublished;
    asPublished.primitives = tessera::Primitives::processor;
    for (const std::string& name : options.algorithms) {
        bound.push_back(tessera::findResampler(name).bind(file.mesh, fields, asPublished));
        runOnce(*bound.back(), task, options.threads);
    }
    std::vector<std::vector<Sample>> samples(bound.size());
    for (int r = 0; r < options.runs; ++r)
        for (std::size_t a = 0; a < bound.size(); ++a)
            samples[a].push_back(runOnce(*bound[a], task, options.threads));
    std::vector<Row> rows;
    for (std::size_t a = 0; a < bound.size(); ++a) {
        if (options.isHashed) fmt::print("{} {:016x}\n", options.algorithms[a], hashBlocks(*bound[a], task));
        rows.push_back({options.algorithms[a], file.mesh.elementCount(), activePairs(file.mesh, task.lattice),
                        medianOf(samples[a], [](const Sample& s) { return s.wallMs; }),
                        medianOf(samples[a], [](const Sample& s) { return s.processorMs; }),
                        samples[a].front().statistics});
    }
    return rows;
}

void measure(const Options& options) {
    fmt::print(
        "{}^3 points, one field, {} threads, median of {} interleaved runs after one that isn't timed\n",
        options.points, options.threads, options.runs);
    fmt::print("{:>9} {:<8} {:>10} {:>10} {:>10} {:>8} {:>9} {:>8} {:>9} {:>9} {:>9}\n", "elements", "",
               "pairs", "active", "polygons", "ms", "processor", "ns/pair", "growth", "ns/active", "growth");
    std::string csv =
        "elements,algorithm,points,threads,runs,pairs,active_pairs,polygons,wall_ms,processor_ms,ns_per_pair,"
        "ns_per_active_pair,vertices,fragments,upload_bytes,read_back_bytes,prepare_ms,generate_ms,"
        "render_ms\n";
    std::vector<Row> all;
    std::map<std::string, Row> smallest;
    for (const std::string& path : options.meshPaths)
        for (const Row& row : measureMesh(options, path)) {
            printPairs(row, smallest.try_emplace(row.algorithm, row).first->second);
            csv += csvOf(options, row);
            all.push_back(row);
        }
    printDeviceCost(all);
    tessera::bench::writeText(options.csvPath, csv);
}

}  // namespace

int main(int count, char** words) {
    Options options;
    tessera::bench::Arguments arguments("Time per element-slice pair against the size of the mesh.");
    arguments.addNeeded("meshes", options.meshPaths, "files of make_graded_mesh.py, the smallest first");
    arguments.add("--algorithms", options.algorithms, "slicing, hybrid");
    arguments.add("--points", options.points, "lattice points along an axis", {2, 2048});
    arguments.add("--runs", options.runs, "", {1, 1000});
    arguments.add("--threads", options.threads, "", {1, 1024});
    arguments.add("--csv", options.csvPath, "also write the figures here");
    arguments.add("--hash", options.isHashed, "also print a hash of all samples");
    return arguments.run(count, words, [&] {
        measure(options);
        return 0;
    });
}
