// What one brick costs: bricks of 16^3 points and blocks of 64^3 at random places of a mesh, each at a level
// where it holds about a given number of elements. brick_cost [mesh.vtu...] [--elements
// 100000,1000000,5000000]
// [--algorithms software] [--bricks 200] [--threads 1]
//
// Bricks are drawn by a fixed seed and sampled one by one by one bound resampler, the first call apart: that
// one builds the element index. "near" are the elements that the index finds, "pairs" those of them whose box
// holds a lattice point, "lists" the time to find and place them; of the OpenGL algorithms that and making
// their primitives: the processor's part.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "arguments.h"
#include "base/timer.h"
#include "bench_statistics.h"
#include "benchmark/graded_box.h"
#include "mesh/element_index.h"
#include "mesh_files/read_mesh.h"
#include "reference/fields.h"
#include "reference/random.h"
#include "resample/statistic_names.h"
#include "resample/stoppable_sampling.h"
#include "tessera/lattice.h"
#include "tessera/registry.h"

namespace {

namespace counted = tessera::counted;
namespace stage = tessera::stage;
using tessera::Box3d;
using tessera::TetMesh;
using tessera::Vec3d;
using tessera::Vec3i;
using tessera::gradedBox;

struct Options {
    std::vector<std::string> meshPaths;
    std::vector<std::int64_t> elements{100000, 1000000, 5000000};
    std::vector<std::string> algorithms{"software"};
    std::vector<std::string> bricks{"16:30", "16:100", "16:300", "16:1000", "64:3000", "64:10000"};
    int count = 200, threads = 1, indexThreads = 2;
};

struct Brick {
    tessera::Lattice lattice;
    tessera::IndexBox box;
};

/// A brick at a random element, on the level of the mesh's lattices where it holds about as many elements as
/// asked for, up to a factor of 1.4.
std::vector<Brick> drawBricks(const TetMesh& mesh, const tessera::ElementIndex& index, int edge,
                              double wanted, int count) {
    tessera::Random random(std::uint64_t(edge) * 7919 + std::uint64_t(wanted));
    const Box3d bounds = index.boundsWorld();
    const Vec3d size = bounds.size();
    const double longest = std::max({size.x, size.y, size.z});
    std::vector<Brick> bricks;
    for (int trial = 0; trial < 200 * count && int(bricks.size()) < count; ++trial) {
        const auto& tet = mesh.tets[std::size_t(random.below(int(mesh.elementCount())))];
        const Vec3d place = mesh.points[std::size_t(tet[0])];
        const double finest = longest * (0.6 + 0.8 * random.unit()) * 0x1p-24;
        for (int level = 0; level < 24; ++level) {
            const double h = std::ldexp(finest, level);
            const Vec3i key(glm::floor((place - bounds.min) / (h * edge)));
            const Brick brick{tessera::Lattice::axisParallel(bounds.min, h),
                              {key * edge, key * edge + edge + 1}};
            const Box3d world{bounds.min + h * Vec3d(brick.box.min),
                              bounds.min + h * Vec3d(brick.box.max - 1)};
            const double held = double(index.count(world));
            if (held > 1.4 * wanted) break;
            if (held >= wanted / 1.4) {
                bricks.push_back(brick);
                break;
            }
        }
    }
    return bricks;
}

struct Sample {
    double us = 0, processorUs = 0;
    std::int64_t near = 0, pairs = 0;
};

double quantile(std::vector<double> values, double share) {
    std::sort(values.begin(), values.end());
    return values[std::min(values.size() - 1, std::size_t(share * double(values.size())))];
}

/// One coarse brick in steps of a millisecond, as between two frames.
void measureSteps(const TetMesh& mesh, const std::shared_ptr<const tessera::SharedElementIndex>& index,
                  tessera::BoundResampler& bound, const tessera::Execution& one) {
    constexpr double kElements = 1e5;
    const std::vector<Brick> bricks = drawBricks(mesh, index->get(), 16, kElements, 10);
    std::vector<double> steps;
    for (const Brick& brick : bricks) {
        tessera::StoppableSampling sampling(bound, index, brick.lattice, std::span(&brick.box, 1),
                                            [](std::size_t, const tessera::Block&) {});
        while (!sampling.isDone()) {
            tessera::Timer timer;
            sampling.advance(std::chrono::steady_clock::now() + std::chrono::milliseconds(1), one);
            steps.push_back(timer.elapsedMs());
        }
    }
    if (!steps.empty())
        fmt::print(
            "  bricks of 17^3 points with {:.0f} elements, stopped after 1 ms: {:.0f} steps a brick, median "
            "{:.2f} ms, 99 % {:.2f} ms\n",
            kElements, double(steps.size()) / double(bricks.size()), quantile(steps, 0.5),
            quantile(steps, 0.99));
}

void measure(const Options& options, const std::string& name, const TetMesh& mesh) {
    tessera::Execution many;
    many.threads = options.indexThreads;
    const auto shared = std::make_shared<const tessera::SharedElementIndex>(mesh);
    tessera::Timer timer;
    const tessera::ElementIndex& index = shared->get(many);
    const double indexMs = timer.restart();
    fmt::print("\n{}: {} elements; index built in {:.0f} ms on {} threads, {:.1f} bytes an element\n", name,
               mesh.elementCount(), indexMs, options.indexThreads,
               double(index.memoryBytes()) / double(mesh.elementCount()));
    fmt::print("{:<9} {:>5} {:>7} {:>7} {:>9} {:>9} {:>11} {:>11} {:>10} {:>8}\n", "algorithm", "edge",
               "wanted", "bricks", "near", "pairs", "median, us", "99 %, us", "lists, us", "ns/pair");
    tessera::Execution one;
    one.threads = options.threads;
    std::vector<int> fields;
    if (!mesh.fields.empty()) fields.push_back(0);
    for (const std::string& algorithm : options.algorithms) {
        tessera::BindOptions bind;
        bind.index = shared;
        const auto bound = tessera::findResampler(algorithm).bind(mesh, fields, bind);
        bool isFirst = true;
        for (const std::string& kind : options.bricks) {
            int edge = 0;
            double wanted = 0;
            if (std::sscanf(kind.c_str(), "%d:%lf", &edge, &wanted) != 2)
                throw std::runtime_error("--bricks takes edge:elements, got " + kind);
            const std::vector<Brick> bricks = drawBricks(mesh, index, edge, wanted, options.count);
            if (bricks.empty()) {
                fmt::print("{:<9} {:>5} {:>7} no brick of this mesh holds so many\n", algorithm, edge,
                           wanted);
                continue;
            }
            std::vector<Sample> samples;
            double sum = 0;
            const auto sink = [&](std::size_t, const tessera::Block& block) { sum += block.values[0]; };
            for (const Brick& brick : bricks) {
                if (isFirst) bound->resample(brick.lattice, std::span(&brick.box, 1), sink, one);
                isFirst = false;
                timer.restart();
                const tessera::ResampleStatistics s =
                    bound->resample(brick.lattice, std::span(&brick.box, 1), sink, one);
                const double us = 1000 * timer.restart();
                samples.push_back({us, 1000 * (s.ms(stage::bin) + s.ms(stage::generate)),
                                   s.count(counted::elementsNear), s.count(counted::elementBlockPairs)});
            }
            const auto all = [&](auto figure) {
                std::vector<double> values;
                for (const Sample& sample : samples) values.push_back(double(sample.*figure));
                return values;
            };
            const double median = quantile(all(&Sample::us), 0.5), pairs = quantile(all(&Sample::pairs), 0.5);
            fmt::print("{:<9} {:>5} {:>7} {:>7} {:>9} {:>9} {:>11.1f} {:>11.1f} {:>10.1f} {:>8.0f}\n",
                       algorithm, edge, wanted, bricks.size(), quantile(all(&Sample::near), 0.5), pairs,
                       median, quantile(all(&Sample::us), 0.99), quantile(all(&Sample::processorUs), 0.5),
                       1000 * median / std::max(1.0, pairs));
            std::fflush(stdout);
        }
        measureSteps(mesh, shared, *bound, one);
    }
}

}  // namespace

int main(int count, char** words) {
    Options options;
    tessera::bench::Arguments arguments("Time to sample one brick against the elements that it holds");
    arguments.add("meshes", options.meshPaths, "mesh files; without, graded boxes of --elements");
    arguments.add("--elements", options.elements, "sizes of the graded boxes");
    arguments.add("--algorithms", options.algorithms);
    arguments.add("--bricks", options.bricks, "kinds of bricks, edge:elements");
    arguments.add("--count", options.count, "bricks of a kind");
    arguments.add("--threads", options.threads);
    arguments.add("--index-threads", options.indexThreads);
    return arguments.run(count, words, [&] {
        for (const std::string& path : options.meshPaths)
            measure(options, path, tessera::readMesh(path, {}, {}).mesh);
        if (options.meshPaths.empty())
            for (const std::int64_t elements : options.elements)
                measure(options, "graded box", gradedBox(elements));
        return 0;
    });
}
