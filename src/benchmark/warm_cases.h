#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "benchmark/benchmark_variants.h"
#include "benchmark/timed_cases.h"
#include "device/device_samples.h"
#include "gl/gl_thread.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

/// Sampling alone, by a resampler that is bound already and has sampled before, as a viewer or a service
/// would: into blocks of this process, or into textures that stay on the device.
struct WarmCase {
    const BenchmarkVariant* variant = nullptr;
    const TetMesh* mesh = nullptr;  ///< its field 0 is sampled
    std::string name;               ///< "64^3"
    Lattice lattice;
    std::vector<IndexBox> boxes;
    GlThread* device = nullptr;  ///< null: into blocks

    double bindMs = 0;
    std::unique_ptr<BoundResampler> bound;
    std::shared_ptr<DeviceSamples> slots;
};

/// `points` of one spacing along the longest side of the bounds, as one cube of boxes of 64^3.
WarmCase warmCube(const BenchmarkVariant& variant, const TetMesh& mesh, int points, GlThread* device);
/// 4 x 4 x 4 bricks of 16^3 in the middle, or the one in the middle alone, on the lattice of 256 points.
WarmCase warmBricks(const BenchmarkVariant& variant, const TetMesh& mesh, int perEdge, GlThread* device);

/// What is run; binds before its first run. Refers to the case, which must stay where it is.
TimedCase timedCase(WarmCase& warm, const std::string& ladder);

Json warmJson(const WarmCase& warm, const TimedCase& times);

}  // namespace tessera
