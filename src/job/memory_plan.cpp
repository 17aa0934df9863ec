#include "job/memory_plan.h"

#include <fmt/format.h>

#include <cmath>

#include "job/report_text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

// Measured on a mesh of a million elements and rounded up: the program with its libraries; what planning by
// element size, the costliest, and sampling hold an element and a node; blocks in flight and write buffers.
constexpr double kMiB = 1 << 20;
constexpr double kProgramBytes = 96 * kMiB;
constexpr double kBytesPerElement = 96, kBytesPerNode = 96;
constexpr double kBlockBytes = 32 * kMiB, kBlockBytesPerChannel = 8 * kMiB;
constexpr double kSampleShare = 0.8;  // the rest: what tiles and trees need beside values
constexpr double kSmallestSamples = 4 * kMiB;

double meshBytes(const TetMesh& mesh) {
    double bytes =
        double(mesh.points.size()) * sizeof(Vec3d) + double(mesh.tets.size()) * sizeof(mesh.tets[0]);
    for (const Field& field : mesh.fields) bytes += double(field.values.size()) * sizeof(double);
    return bytes;
}

}  // namespace

SampleBudget sampleBudget(std::int64_t maxMemoryBytes, const TetMesh& mesh, int channels, bool flat) {
    const double work = kProgramBytes + meshBytes(mesh) + kBytesPerElement * double(mesh.elementCount()) +
                        kBytesPerNode * double(mesh.nodeCount()) + kBlockBytes +
                        kBlockBytesPerChannel * channels;
    const double left = (double(maxMemoryBytes) - work) * kSampleShare;
    if (left < kSmallestSamples)
        throw InputError(
            fmt::format("--max-memory: {} MiB is too little: {} elements, {} nodes and the work on them take "
                        "{} MiB before "
                        "the first sample; --max-memory {}M would be enough for a coarse result",
                        std::int64_t(double(maxMemoryBytes) / kMiB), formatCount(mesh.elementCount()),
                        formatCount(mesh.nodeCount()), std::int64_t(std::ceil(work / kMiB)),
                        std::int64_t(std::ceil((work + 2 * kSmallestSamples / kSampleShare) / kMiB))));
    return {std::int64_t(flat ? left / 2 : left), std::int64_t(left / 2)};
}

}  // namespace tessera
