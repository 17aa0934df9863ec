#include "benchmark/warm_cases.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/timer.h"
#include "benchmark/peer_resampler.h"
#include "compare/sampling_grid.h"
#include "resample/statistic_names.h"

namespace tessera {

namespace {

constexpr int kBlockEdge = 64, kBrickEdge = 16, kBrickLattice = 256;

Lattice latticeOf(const TetMesh& mesh, int points) {
    const Box3d bounds = mesh.boundsWorld();
    const Vec3d size = bounds.size();
    return Lattice::axisParallel(bounds.min, std::max({size.x, size.y, size.z}) / (points - 1));
}

}  // namespace

WarmCase warmCube(const BenchmarkVariant& variant, const TetMesh& mesh, int points, GlThread* device) {
    WarmCase warm;
    warm.variant = &variant;
    warm.mesh = &mesh;
    warm.name = fmt::format("{}^3", points);
    warm.lattice = latticeOf(mesh, points);
    const IndexBox all{Vec3i(0), Vec3i(points)};
    warm.boxes = device ? std::vector{all} : cutIntoBoxes(all, kBlockEdge);
    warm.device = device;
    return warm;
}

WarmCase warmBricks(const BenchmarkVariant& variant, const TetMesh& mesh, int perEdge, GlThread* device) {
    WarmCase warm;
    warm.variant = &variant;
    warm.mesh = &mesh;
    warm.name =
        perEdge == 1 ? "one brick of 16^3" : fmt::format("{} bricks of 16^3", perEdge * perEdge * perEdge);
    warm.lattice = latticeOf(mesh, kBrickLattice);
    const Vec3d size = mesh.boundsWorld().size() / warm.lattice.uWorld.x;
    const Vec3i low = Vec3i(glm::floor(size * (0.5 / kBrickEdge))) * kBrickEdge - perEdge / 2 * kBrickEdge;
    warm.boxes = cutIntoBoxes({low, low + perEdge * kBrickEdge}, kBrickEdge);
    warm.device = device;
    return warm;
}

TimedCase timedCase(WarmCase& warm, const std::string& ladder) {
    TimedCase one;
    one.what = fmt::format("{}, {} {}", warm.variant->name, warm.name,
                           warm.device ? "left on the device" : "into blocks");
    one.ladder = ladder;
    for (const IndexBox& box : warm.boxes) one.work += double(box.count());
    const auto run = [&warm](const Execution& execution) {
        Execution own = execution.withoutProgress();
        own.threads = warm.variant->threads;
        CaseSample sample = timed([&] {
            return warm.device ? warm.bound->resampleToDevice(warm.lattice, warm.boxes, *warm.slots, own)
                               : warm.bound->resample(
                                     warm.lattice, warm.boxes, [](std::size_t, const Block&) {}, own);
        });
        sample.ms -= sample.statistics.ms(kTransferStage);
        return sample;
    };
    one.run = run;
    one.prepare = [&warm, run](const Execution& execution) {
        const Timer timer;
        const std::vector<int> fields{0};
        warm.bound = warm.variant->resampler->bind(*warm.mesh, fields, warm.variant->bind);
        warm.bindMs = timer.elapsedMs();
        if (warm.device)
            warm.slots = DeviceSamples::make(*warm.device, warm.boxes,
                                             codingsOf(*warm.mesh, fields, warm.variant->bind.format),
                                             warm.variant->bind.format);
        run(execution);
    };
    return one;
}

Json warmJson(const WarmCase& warm, const TimedCase& times) {
    const ResampleStatistics& last = times.samples.back().statistics;
    const std::int64_t slices = last.count(counted::elementSlicePairs);
    const std::int64_t pairs = slices > 0 ? slices : last.count(counted::elementBlockPairs);
    const MedianInterval ms = times.interval();
    const bool isOnDevice = warm.variant->resampler->info().isOnDevice;
    Json json{{"variant", warm.variant->name},
              {"case", warm.name},
              {"to", warm.device ? "device" : "blocks"},
              {"bind_ms", warm.bindMs},
              {"ms", intervalJson(ms)},
              {"processor_ms", times.medianOf([](const CaseSample& s) { return s.processorMs; })},
              {"render_ms", nullptr},
              {"upload_bytes", last.count(counted::uploadBytes)},
              {"read_back_bytes", last.count(counted::readBackBytes)},
              {"elements_near", last.count(counted::elementsNear)},
              {"pairs", pairs},
              {"ns_a_pair", pairs > 0 ? Json(ms.median * 1e6 / double(pairs)) : Json(nullptr)}};
    if (isOnDevice)
        json["render_ms"] =
            times.medianOf([](const CaseSample& s) { return s.statistics.ms(stage::render); });
    return json;
}

}  // namespace tessera
