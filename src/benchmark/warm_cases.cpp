#include "benchmark/warm_cases.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/timer.h"
#include "benchmark/peer_resampler.h"
#include "compare/sampling_grid.h"
#include "job/report_text.h"
#include "reference/random.h"
#include "resample/statistic_names.h"

namespace tessera {

namespace {

constexpr int kBlockEdge = 64, kBrickEdge = 16, kBrickLattice = 256, kBricksAtFocus = 4;
constexpr int kSingleBricks = 16, kTrialsABrick = 200, kLevels = 24;

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
    const IndexBox all{Vec3i(0), Vec3i(points)};
    warm.parts.push_back(
        {latticeOf(mesh, points), device ? std::vector{all} : cutIntoBoxes(all, kBlockEdge), nullptr});
    warm.device = device;
    return warm;
}

WarmCase warmFocus(const BenchmarkVariant& variant, const TetMesh& mesh, GlThread* device) {
    WarmCase warm;
    warm.variant = &variant;
    warm.mesh = &mesh;
    warm.name = "64 bricks of 16^3";
    const Lattice lattice = latticeOf(mesh, kBrickLattice);
    const Vec3d size = mesh.boundsWorld().size() / lattice.uWorld.x;
    const Vec3i low = (Vec3i(glm::floor(size * (0.5 / kBrickEdge))) - kBricksAtFocus / 2) * kBrickEdge;
    warm.parts.push_back(
        {lattice, cutIntoBoxes({low, low + kBricksAtFocus * kBrickEdge}, kBrickEdge), nullptr});
    warm.device = device;
    return warm;
}

std::optional<WarmCase> warmBrick(const BenchmarkVariant& variant, const TetMesh& mesh,
                                  const ElementIndex& index, int edge, int elements, GlThread* device) {
    WarmCase warm;
    warm.variant = &variant;
    warm.mesh = &mesh;
    warm.name = fmt::format("a brick of {}^3, {} elements", edge, formatCount(elements));
    warm.device = device;
    Random random(std::uint64_t(edge) * 7919 + std::uint64_t(elements));
    const Box3d bounds = index.boundsWorld();
    const Vec3d size = bounds.size();
    const double longest = std::max({size.x, size.y, size.z});
    for (int trial = 0; trial < kTrialsABrick * kSingleBricks && int(warm.parts.size()) < kSingleBricks;
         ++trial) {
        const auto& tet = mesh.tets[std::size_t(random.below(int(mesh.elementCount())))];
        const Vec3d place = mesh.points[std::size_t(tet[0])];
        const double finest = longest * (0.6 + 0.8 * random.unit()) * std::ldexp(1.0, -kLevels);
        for (int level = 0; level < kLevels; ++level) {
            const double h = std::ldexp(finest, level);
            const Vec3i key(glm::floor((place - bounds.min) / (h * edge)));
            const IndexBox box{key * edge, key * edge + edge + 1};
            const double held =
                double(index.count({bounds.min + h * Vec3d(box.min), bounds.min + h * Vec3d(box.max - 1)}));
            if (held > 1.4 * elements) break;
            if (held < elements / 1.4) continue;
            warm.parts.push_back({Lattice::axisParallel(bounds.min, h), {box}, nullptr});
            break;
        }
    }
    return warm.parts.empty() ? std::nullopt : std::optional(std::move(warm));
}

TimedCase timedCase(WarmCase& warm, const std::string& ladder) {
    TimedCase one;
    one.what = fmt::format("{}, {} {}", warm.variant->name, warm.name,
                           warm.device ? "left on the device" : "into blocks");
    one.ladder = ladder;
    for (const WarmCase::Part& part : warm.parts)
        for (const IndexBox& box : part.boxes) one.work += double(box.count());
    const auto run = [&warm](const Execution& execution) {
        const Execution own = warm.variant->executionFrom(execution);
        CaseSample sample = timed([&] {
            ResampleStatistics statistics;
            for (WarmCase::Part& part : warm.parts)
                statistics += warm.device
                                  ? warm.bound->resampleToDevice(part.lattice, part.boxes, *part.slots, own)
                                  : warm.bound->resample(
                                        part.lattice, part.boxes, [](std::size_t, const Block&) {}, own);
            return statistics;
        });
        const auto parts = double(warm.parts.size());
        sample.ms = (sample.ms - sample.statistics.ms(kTransferStage)) / parts;
        sample.processorMs /= parts;
        return sample;
    };
    one.run = run;
    one.prepare = [&warm, run](const Execution& execution) {
        const Timer timer;
        const std::vector<int> fields{0};
        warm.bound = warm.variant->resampler->bind(*warm.mesh, fields, warm.variant->bind);
        warm.bindMs = timer.elapsedMs();
        for (WarmCase::Part& part : warm.parts)
            if (warm.device)
                part.slots = DeviceSamples::make(*warm.device, part.boxes,
                                                 codingsOf(*warm.mesh, fields, warm.variant->bind.format),
                                                 warm.variant->bind.format);
        run(execution);
    };
    return one;
}

Json warmJson(const WarmCase& warm, const TimedCase& times) {
    const ResampleStatistics& last = times.samples.back().statistics;
    const auto parts = std::int64_t(warm.parts.size());
    const auto count = [&](std::string_view name) { return last.count(name) / parts; };
    const std::int64_t pairs = pairsOf(last) / parts;
    const MedianInterval ms = times.interval();
    const bool isOnDevice = warm.variant->resampler->info().isOnDevice;
    Json json{{"variant", warm.variant->name},
              {"case", warm.name},
              {"to", warm.device ? "device" : "blocks"},
              {"bind_ms", warm.bindMs},
              {"ms", intervalJson(ms)},
              {"processor_ms", times.medianOf([](const CaseSample& s) { return s.processorMs; })},
              {"render_ms", nullptr},
              {"upload_bytes", count(counted::uploadBytes)},
              {"read_back_bytes", count(counted::readBackBytes)},
              {"elements_near", count(counted::elementsNear)},
              {"pairs", pairs},
              {"ns_a_pair", pairs > 0 ? Json(ms.median * 1e6 / double(pairs)) : Json(nullptr)}};
    if (isOnDevice)
        json["render_ms"] = times.medianOf([](const CaseSample& s) {
            return s.statistics.ms(stage::render);
        }) / double(parts);
    return json;
}

}  // namespace tessera
