#pragma once

#include <gmpxx.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/large_pages.h"
#include "tessera/execution.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

/// One component of one field.
struct ScanChannel {
    const double* values;  ///< interleaved
    int components;
    int component;
    bool cell;

    double at(std::int32_t item) const { return values[std::int64_t(item) * components + component]; }
};

/// 113 bits: what an element too thin for double is computed in.
__extension__ typedef __float128 Quad;

/// The nodes of a mesh in the index space of a lattice.
///
/// Coordinates are kept as whole + part, part in about [0, 1): positions relative to an element's own first
/// voxel then come out with an error of a few 2^-53 of the element's size in voxels, however far from the
/// origin the element lies.
struct NodeFrame {
    struct alignas(64) Node {  // a cache line each: elements reach for them in no order
        double whole[3];
        double part[3];   ///< absolute error at most 4 * 2^-53
        double value[2];  ///< of the first channels, as many as `valueCount`
    };
    Lattice lattice;
    UninitializedVector<Node> nodes;
    int valueCount = 0;
    struct alignas(16) Rough {
        float index[4];  ///< rounded index coordinates and 0
    };
    UninitializedVector<Rough> rough;  ///< for culling only
};

/// @param channels whose values at the nodes are wanted beside their places: kept are those of the first two,
/// unless they are of cells.
NodeFrame frameNodes(const TetMesh& mesh, const Lattice& lattice, const Execution& execution,
                     std::span<const ScanChannel> channels = {});

/// Index coordinates of a place, relative error about 2^-112 of the largest.
std::array<Quad, 3> quadIndexFromWorld(const Lattice& lattice, const Vec3d& pointWorld);

/// Exact index coordinates of a place.
std::array<mpq_class, 3> exactIndexFromWorld(const Lattice& lattice, const Vec3d& pointWorld);

}  // namespace tessera
