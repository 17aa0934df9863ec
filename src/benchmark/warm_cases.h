#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "benchmark/benchmark_variants.h"
#include "benchmark/timed_cases.h"
#include "device/device_samples.h"
#include "gl/gl_thread.h"
#include "mesh/element_index.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

/// Sampling alone, by a resampler that is bound already and has sampled before, as a viewer or a service
/// would: into blocks of this process, or into textures that stay on the device.
struct WarmCase {
    const BenchmarkVariant* variant = nullptr;
    const TetMesh* mesh = nullptr;  ///< its field 0 is sampled
    std::string name;               ///< "64^3"
    /// Sampled one after the other; times are those of one, on the average.
    struct Part {
        Lattice lattice;
        std::vector<IndexBox> boxes;
        std::shared_ptr<DeviceSamples> slots;
    };
    std::vector<Part> parts;
    GlThread* device = nullptr;  ///< null: into blocks

    double bindMs = 0;
    std::unique_ptr<BoundResampler> bound;
};

/// `points` of one spacing along the longest side of the bounds, as one cube of boxes of 64^3.
WarmCase warmCube(const BenchmarkVariant& variant, const TetMesh& mesh, int points, GlThread* device);
/// 4 x 4 x 4 bricks of 16^3 in the middle of the lattice of 256 points, as around a focus.
WarmCase warmFocus(const BenchmarkVariant& variant, const TetMesh& mesh, GlThread* device);
/// Single bricks of edge^3 cells at random elements, each on the level of the mesh's lattices where it holds
/// about so many elements, up to a factor of 1.4. None where no place holds so many. The same bricks for
/// every variant.
std::optional<WarmCase> warmBrick(const BenchmarkVariant& variant, const TetMesh& mesh,
                                  const ElementIndex& index, int edge, int elements, GlThread* device);

/// What is run; binds before its first run. Refers to the case, which must stay where it is.
TimedCase timedCase(WarmCase& warm, const std::string& ladder);

Json warmJson(const WarmCase& warm, const TimedCase& times);

}  // namespace tessera
