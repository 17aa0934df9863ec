#pragma once

#include <cstdint>
#include <vector>

#include "brick/seams.h"
#include "pictures/image.h"
#include "tessera/execution.h"

namespace tessera {

/// An axis-parallel cut through the reconstruction.
struct SliceOptions {
    /// Which lattice points of the slice's frame lie in the mesh (x fastest); empty: a pixel does when the
    /// nearest stored lattice point does.
    std::vector<std::uint8_t> coverage;
    int axis = 2;                         ///< 0, 1, 2: the cut is normal to x, y or z
    double positionWorld = 0;             ///< along that axis
    int pixels = 800;                     ///< along the longer edge of the picture
    Box3d boundsWorld;                    ///< what the picture shows; empty: all bricks
    bool outlines = false;                ///< mark the edges of the bricks
    const BrickTree* outlined = nullptr;  ///< whose bricks; null: those that are sampled
};

/// The places of a slice's pixels: the centre of pixel (x, y), y downwards, is lattice point (x, height - 1 -
/// y, 0).
struct SliceFrame {
    Lattice lattice;
    int width = 0, height = 0;
};

/// Throws InputError as sampleSlice does.
SliceFrame sliceFrame(const BrickTree& tree, const SliceOptions& options);

/// Samples one channel on a cut. Its first axis runs to the right and its second up: (x, y) for z, (x, z) for
/// y, (y, z) for x. A pixel has a value where it lies in the mesh, see SliceOptions::coverage.
/// Throws InputError for options out of range.
ScalarImage sampleSlice(const BrickTree& tree, const Reconstruction& reconstruction, int channel,
                        const SliceOptions& options, const Execution& execution);

}  // namespace tessera
