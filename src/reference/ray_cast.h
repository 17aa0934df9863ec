#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/rgba_image.h"
#include "brick/brick_tree.h"
#include "brick/seams.h"
#include "mesh/field_range.h"
#include "reference/mesh_rays.h"
#include "tessera/execution.h"
#include "tessera/focus.h"
#include "tessera/transfer_function.h"

namespace tessera {

/// How two pictures of one size differ in red, green and blue.
struct ImageDifference {
    double sumOfSquares = 0;  ///< over all pixels and the three colours
    double largest = 0;
    /// The root of the mean square over so many pixels.
    double rms(std::int64_t pixels) const;
};
/// Throws InputError for pictures of different sizes.
ImageDifference differenceOf(const RgbaImage& a, const RgbaImage& b);

struct RayCastOptions {
    /// A layer as thick as this has the opacity that the transfer function gives; world units, above 0.
    double layerWorld = 1;
    /// Length of a step, in voxels of the brick that the ray is in; above 0.
    double stepVoxels = 0.25;
    /// Above 0: steps end on planes across the view in place, so many to a voxel, counted from the eye.
    double slicesAVoxel = 0;
};

/// What is at the points of a brick's closed box, x the fastest.
struct BrickPoints {
    std::vector<float> values;
    std::vector<float> surface;  ///< below 0 outside the mesh
};

/// Draws one channel of a reconstruction: along each ray, from the front to the back, a step of length s in
/// the middle of which the transfer function has the colour C and the opacity a adds C T A and leaves
/// T (1 - A) of the light T, A = 1 - (1 - a)^(s / layer). It is absorption plus emission by the midpoint rule
/// (N. Max, Optical Models for Direct Volume Rendering, 1995): exact in bricks of one value, off by the
/// square of the step where the transfer function is smooth. Only what lies in the mesh is drawn, and no
/// value that isn't finite. The same for any number of threads.
class RayCaster {
  public:
    /// @param points of each leaf of the tree.
    RayCaster(const BrickTree& tree, std::vector<BrickPoints> points);
    /// Copies the tree and the values of the closed boxes of its leaves, 4 (B + 1)^3 bytes each.
    RayCaster(const BrickTree& tree, const Reconstruction& reconstruction, int channel,
              const Execution& execution);

    /// Throws InputError for a transfer function that isn't one and options out of range.
    RgbaImage draw(const MeshRays& rays, const TransferFunction& function, const RayCastOptions& options,
                   const Execution& execution) const;
    /// Without a mesh: what lies in all of `within`, where the points' `surface`, interpolated, isn't below
    /// 0.
    RgbaImage draw(const Camera& camera, std::span<const HalfSpace> within, const TransferFunction& function,
                   const RayCastOptions& options, const Execution& execution) const;

  private:
    /// With the range of the finite values.
    struct Brick : BrickPoints {
        ValueRange range;
    };
    class Ray;

    void findRange(Brick& brick) const;
    template <class SpansOf>
    RgbaImage drawAlong(const Camera& camera, const SpansOf& spansOf, bool isOutlinedBySamples,
                        const TransferFunction& function, const RayCastOptions& options,
                        const Execution& execution) const;

    BrickTree tree_;
    std::vector<Brick> bricks_;  ///< by leaf
};

}  // namespace tessera
