#include "memory_plan.h"

#include <fmt/format.h>

#include "base/error.h"
#include "report_text.h"

namespace tessera {

namespace {

// Measured on a mesh of a million elements and rounded up: the program with its libraries; what planning by
// element size, the costliest, and sampling hold an element and a node; blocks in flight and write buffers.
constexpr double kProgramBytes = 96 << 20;
constexpr double kBytesPerElement = 96, kBytesPerNode = 96;
constexpr double kBlockBytes = 32 << 20, kBlockBytesPerChannel = 8 << 20;
constexpr double kSampleShare = 0.8;  // the rest: what tiles and trees need beside values
constexpr double kSmallestSamples = 4 << 20;

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
            fmt::format("--max-memory: {} is too little: {} elements, {} nodes and the work on them take {} "
                        "before the first "
                        "sample; --max-memory {}M would be enough for a coarse result",
                        formatBytes(maxMemoryBytes), formatCount(mesh.elementCount()),
                        formatCount(mesh.nodeCount()), formatBytes(std::int64_t(work)),
                        std::int64_t((work + 2 * kSmallestSamples / kSampleShare) / (1 << 20)) + 1));
    return {std::int64_t(flat ? left / 2 : left), std::int64_t(left / 2)};
}

}  // namespace tessera
