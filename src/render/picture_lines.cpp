#include "render/picture_lines.h"

#include <algorithm>
#include <cmath>

namespace tessera {

namespace {

/// In sizes of what is drawn: nearer to the eye nothing is.
constexpr double kNearest = 1e-7;

std::uint32_t packed(const MarkColor& color) {
    std::uint32_t bytes = 0;
    for (std::size_t c = 0; c < 3; ++c)
        bytes |= std::uint32_t(std::lround(255 * std::clamp(color[c], 0.0, 1.0))) << (8 * c);
    return bytes;
}

/// A segment's part from `begin` to `end`, shares of it.
struct Part {
    double begin = 0, end = 1;

    /// Keeps what has a distance of at least 0; it is linear.
    void keep(double atFrom, double atTo) {
        if (!(atFrom >= 0) && !(atTo >= 0)) {
            end = -1;
        } else if (atFrom < 0) {
            begin = std::max(begin, atFrom / (atFrom - atTo));
        } else if (atTo < 0) {
            end = std::min(end, atFrom / (atFrom - atTo));
        }
    }
};

}  // namespace

int dotPixelsOf(const Camera& camera) {
    return std::max(1, int(std::lround(std::min(camera.heightPixels / 400.0, camera.widthPixels / 500.0))));
}

ProjectedLines projectLines(std::span<const LineSegment> segments, std::span<const HalfSpace> within,
                            const Camera& camera, const Vec3d& originWorld, int side) {
    const CameraView view = viewOf(camera);
    const double rays = camera.heightPixels * double(side), wideRays = camera.widthPixels * double(side);
    double size = 0;
    for (const LineSegment& segment : segments)
        for (const Vec3d& p : {segment.fromWorld, segment.toWorld})
            size = std::max(size, glm::length(p - camera.eyeWorld));
    ProjectedLines projected;
    double nearest = INFINITY, farthest = -INFINITY;
    for (const LineSegment& segment : segments) {
        // Coordinates of the view: right and up in halves of the picture, and away from the eye.
        const auto inView = [&](const Vec3d& p) {
            const Vec3d d = p - camera.eyeWorld;
            return Vec3d(glm::dot(d, view.right) / view.wide, glm::dot(d, view.up) / view.high,
                         glm::dot(d, view.forward));
        };
        const Vec3d from = inView(segment.fromWorld), to = inView(segment.toWorld);
        Part part;
        part.keep(from.z - kNearest * size, to.z - kNearest * size);
        const double width = segment.widthPixels * side;
        for (int a = 0; a < 2; ++a)
            for (const double sign : {-1.0, 1.0}) {
                // With a line's width and a ray beyond the border.
                const double border = 1 + (width + 2) / (a == 0 ? wideRays : rays) * 2;
                const auto inside = [&](const Vec3d& p) {
                    return (view.isParallel ? 1 : p.z) * border - sign * p[a];
                };
                part.keep(inside(from), inside(to));
            }
        if (segment.isClipped)
            for (const HalfSpace& half : within)
                part.keep(glm::dot(half.normalWorld, segment.fromWorld) - half.offsetWorld,
                          glm::dot(half.normalWorld, segment.toWorld) - half.offsetWorld);
        if (!(part.begin <= part.end)) continue;
        DeviceLine line{};
        const auto place = [&](double share, std::array<float, 2>& rayPlace, float& depth) {
            const Vec3d p = glm::mix(from, to, share);
            const double w = view.isParallel ? 1 : p.z;
            rayPlace = {float((p.x / w + 1) / 2 * wideRays), float((p.y / w + 1) / 2 * rays)};
            double deep = p.z - glm::dot(originWorld - camera.eyeWorld, view.forward);
            // Rays from an eye meet nothing behind it.
            deep = view.isParallel ? deep - segment.nearerWorld
                                   : std::max(deep - segment.nearerWorld, kNearest * size);
            depth = float(view.isParallel ? deep : 1 / deep);
            nearest = std::min(nearest, deep);
            farthest = std::max(farthest, deep);
        };
        place(part.begin, line.from, line.depths[0]);
        place(part.end, line.to, line.depths[1]);
        line.width = float(width);
        line.color = packed(segment.color);
        projected.lines.push_back(line);
    }
    if (!projected.lines.empty()) projected.nearestWorld = nearest, projected.farthestWorld = farthest;
    return projected;
}

}  // namespace tessera
