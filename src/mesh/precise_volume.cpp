#include "mesh/precise_volume.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "mesh/geometry.h"

namespace tessera {

namespace {

__extension__ typedef __float128 Quad;

constexpr std::int64_t kVolumeChunk = 1 << 14;
constexpr double kGoodEnough = 1e-12;

/// Adds up and keeps what each addition rounds off. After: A. Neumaier, Rundungsfehleranalyse einiger
/// Verfahren zur Summation endlicher Summen, ZAMM 54, 1974.
struct CompensatedSum {
    double sum = 0, rest = 0;
    void add(double value) {
        const double whole = sum + value;
        rest += std::fabs(sum) >= std::fabs(value) ? (sum - whole) + value : (value - whole) + sum;
        sum = whole;
    }
};

double quadVolume(const Corners& c) {
    Quad u[3], v[3], w[3];
    for (int k = 0; k < 3; ++k) {
        u[k] = Quad(c[1][k]) - Quad(c[0][k]);
        v[k] = Quad(c[2][k]) - Quad(c[0][k]);
        w[k] = Quad(c[3][k]) - Quad(c[0][k]);
    }
    const Quad volume = w[0] * (u[1] * v[2] - u[2] * v[1]) + w[1] * (u[2] * v[0] - u[0] * v[2]) +
                        w[2] * (u[0] * v[1] - u[1] * v[0]);
    return std::fabs(double(volume / 6));
}

}  // namespace

double preciseVolume(const Corners& corners) {
    const SixfoldVolume sixfold = sixfoldVolume(corners[0], corners[1], corners[2], corners[3]);
    if (sixfold.errorBound <= kGoodEnough * std::fabs(sixfold.value)) return std::fabs(sixfold.value) / 6;
    return quadVolume(corners);
}

double totalVolume(const TetMesh& mesh, const Execution& execution) {
    const std::int64_t chunks = (mesh.elementCount() + kVolumeChunk - 1) / kVolumeChunk;
    std::vector<CompensatedSum> parts{std::size_t(chunks)};
    parallelFor(execution, chunks, [&](std::int64_t chunk) {
        const std::int64_t end = std::min(mesh.elementCount(), (chunk + 1) * kVolumeChunk);
        for (std::int64_t e = chunk * kVolumeChunk; e < end; ++e)
            parts[std::size_t(chunk)].add(preciseVolume(cornersOf(mesh, e)));
    });
    CompensatedSum all;
    for (const CompensatedSum& part : parts) {
        all.add(part.sum);
        all.add(part.rest);
    }
    return all.sum + all.rest;
}

}  // namespace tessera
