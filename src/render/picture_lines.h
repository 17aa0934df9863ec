#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/picture_marks.h"
#include "refine/camera_view.h"
#include "tessera/vec.h"

namespace tessera {

/// A straight line of one width in the picture, with round ends.
struct LineSegment {
    Vec3d fromWorld{0}, toWorld{0};
    MarkColor color{};
    double widthPixels = 1;
    bool isClipped = false;  ///< only what lies in RenderOptions::within is drawn
    double nearerWorld = 0;  ///< it counts as so much nearer than it is
};

/// What an effect draws for a camera.
struct LineView {
    Camera camera;
    Box3d boundsWorld{};              ///< of the data
    double coarsestSpacingWorld = 0;  ///< of the bricks; 0: it isn't known yet
    double largestBrickNumber = 0;    ///< of those that effects show
};
/// PictureMarks::dotPixels for a picture of that size.
int dotPixelsOf(const Camera& camera);
struct PictureLines {
    std::vector<LineSegment> segments;
    PictureMarks marks;  ///< for the picture when it is drawn
};

/// A line as the shaders have it: a part of the picture, and how far away its ends are.
struct DeviceLine {
    std::array<float, 2> from, to;  ///< rays from the picture's bottom left
    std::array<float, 2> depths;    ///< across the view, world units; with rays from an eye 1 over that
    float width;                    ///< rays
    std::uint32_t color;            ///< a byte each, red the lowest
};
struct ProjectedLines {
    std::vector<DeviceLine> lines;
    /// Of their depths, world units.
    double nearestWorld = 0, farthestWorld = 1;
};

/// The parts of segments that are in the picture. @param originWorld where depths count from. @param side
/// rays along a pixel's edge.
ProjectedLines projectLines(std::span<const LineSegment> segments, std::span<const HalfSpace> within,
                            const Camera& camera, const Vec3d& originWorld, int side);

}  // namespace tessera
