#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/rgba_image.h"
#include "pool/brick_pool.h"
#include "render/effect.h"
#include "render/placed_bricks.h"
#include "tessera/execution.h"
#include "tessera/focus.h"
#include "tessera/transfer_function.h"

namespace tessera {

/// What a picture shows of a pool, and how well.
struct RenderOptions {
    Camera camera;
    TransferFunction function;  ///< its field isn't looked at
    int channel = 0;
    /// A layer as thick as this has the opacity that the transfer function gives; world units, above 0.
    double layerWorld = 1;
    /// Slices to the spacing of the brick that they lie in; above 0.
    double slicesAVoxel = 2;
    /// Only what lies in all of these is shown; 32 at most.
    std::vector<HalfSpace> within;
    /// Rays a pixel, in a square: 1, 4, 9 or 16.
    int samplesAPixel = 1;
    /// Of the values of all that may be shown, whichever bricks are there; empty: of the bricks given.
    ValueRange values;
    /// In the order in which they shade.
    std::vector<Effect> effects;
    bool measuresDevice = false;  ///< RenderCounts::deviceMs; waits for each part of the picture
    /// For effects that need it a number of each brick, at least 0; NaN where it isn't known.
    std::vector<float> brickNumbers;
    /// What of the pool is data, for effects that show its extent.
    Box3d boundsWorld{};
    /// Of the widths of lines, which count in pixels: for a picture that is drawn smaller than it is shown.
    double lineScale = 1;
    /// Rays along an edge of what is drawn at once, 64 to 1024; a picture is cancelled between such parts.
    int raysATile = 1024;
    /// Called before each part; may be null.
    std::function<void()> beforeTile = nullptr;
};

/// Of those that are known; 0 without any.
double largestOf(std::span<const float> brickNumbers);

/// What an effect makes for a picture on the device.
struct EffectResources {
    std::string name;
    int passes = 0, textures = 0;
    std::int64_t bytes = 0;
};

struct RenderCounts {
    std::int64_t bricks = 0;        ///< drawn
    std::int64_t unseenBricks = 0;  ///< left out: beside the picture, or nothing of them is shown
    std::int64_t draws = 0;
    std::int64_t passes = 0;               ///< over each part of the picture, and those of effects
    std::int64_t textures = 0;             ///< beside the pool's
    std::int64_t deviceBytes = 0;          ///< beside the pool
    std::vector<EffectResources> effects;  ///< of those that make any
    double drawMs = 0;                     ///< until the picture is read back
    /// RenderOptions::measuresDevice: what the device took to draw, by its own clock; where it has none, and
    /// of passes of effects, until it had finished.
    double deviceMs = 0;
};

/// Draws the bricks of a pool by slices across the view, composited from the front to the back.
///
/// The slices are slabs between planes across the view, counted from the eye: those of a brick are as thick
/// as its spacing over slicesAVoxel, so slabs of all levels lie in one phase, finer ones half as thick as
/// coarser ones. Where the ray of a pixel runs through slab and brick, for the length s, the value in the
/// middle of that part stands for it: with the colour C and the opacity a of the transfer function there,
/// A = 1 - (1 - a)^(s / layer) of the light is stopped, and C A added. So slices neither overlap nor leave
/// gaps where bricks meet, of whatever levels, and an even medium has the opacity of the ray's length.
///
/// Only what lies in the mesh is drawn: where trilinear interpolation of the samples' coverage, 1 in the mesh
/// and 0 outside, is at least a half, and all samples around that are covered have finite values. A slab that
/// the surface runs through counts for the part before or behind it, the coverage taken as linear between its
/// planes: there are no terraces along the surface. Values are
/// interpolated in floats, not in the few steps of a device's filter. A pixel that lets less than a
/// ten-thousandth of the light through is done.
///
/// A picture depends on the bricks and the options alone, not on their order.
class SliceRenderer {
  public:
    /// The thread must outlive it.
    explicit SliceRenderer(GlThread& thread);
    ~SliceRenderer();
    SliceRenderer(const SliceRenderer&) = delete;
    SliceRenderer& operator=(const SliceRenderer&) = delete;

    /// Red, green and blue are those of the transfer function times the opacity. The pool is one of this
    /// thread, in a state that shows the bricks. Throws InputError for options out of range,
    /// GlError when the device fails or has no room, Cancelled.
    RgbaImage draw(const BrickPool& pool, const PoolState& state, const BrickFrame& frame,
                   std::span<const PlacedBrick> bricks, const RenderOptions& options,
                   const Execution& execution, RenderCounts* counts = nullptr);

  private:
    struct Device;
    GlThread& thread_;
    std::shared_ptr<Device> device_;  // ends on the OpenGL thread
};

}  // namespace tessera
