#include "job/memory_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/machine_memory.h"
#include "job/report_text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

// Measured on a mesh of a million elements and rounded up: the program with its libraries; what planning by
// element size, the costliest, and sampling hold an element and a node.
constexpr double kMiB = 1 << 20;
constexpr double kProgramBytes = 80 * kMiB;
constexpr double kBytesPerElement = 96, kBytesPerNode = 96;
constexpr double kWorkShare = 0.125;  // of what is left, for the resampler's work
constexpr double kSampleShare = 0.8;  // the rest: what tiles and trees need beside values
constexpr double kSmallestSamples = 4 * kMiB;

double meshBytes(const TetMesh& mesh) {
    double bytes =
        double(mesh.points.size()) * sizeof(Vec3d) + double(mesh.tets.size()) * sizeof(mesh.tets[0]);
    for (const Field& field : mesh.fields) bytes += double(field.values.size()) * sizeof(double);
    return bytes;
}

}  // namespace

MemoryShares shareMemory(std::int64_t maxMemoryBytes, const TetMesh& mesh, bool flat,
                         const WorkMemory& work) {
    const bool isGiven = maxMemoryBytes > 0;
    const double all = double(isGiven ? maxMemoryBytes : defaultMemoryBytes());
    const double paid = kProgramBytes + meshBytes(mesh) + kBytesPerElement * double(mesh.elementCount()) +
                        kBytesPerNode * double(mesh.nodeCount()) + double(work.fixed);
    const double least = paid + double(work.least);
    const double workBytes =
        std::clamp((all - paid) * kWorkShare, double(work.least), double(std::max(work.most, work.least)));
    const double left = (all - paid - workBytes) * kSampleShare / work.spread;
    if (left < kSmallestSamples)
        throw InputError(fmt::format(
            "{} is too little: {} elements, {} nodes and the work on them take {} MiB before "
            "the first sample; --max-memory {}M would be enough for a coarse result",
            isGiven ? fmt::format("--max-memory: {} MiB", std::int64_t(all / kMiB))
                    : fmt::format("three quarters of the memory here, {} MiB, without --max-memory,",
                                  std::int64_t(all / kMiB)),
            formatCount(mesh.elementCount()), formatCount(mesh.nodeCount()),
            std::int64_t(std::ceil(least / kMiB)),
            std::int64_t(std::ceil((least + 2 * kSmallestSamples / kSampleShare * work.spread) / kMiB))));
    return {std::int64_t(flat ? left / 2 : left), std::int64_t(left / 2), std::int64_t(workBytes)};
}

}  // namespace tessera
