#include "reference/ray_elements.h"

#include <algorithm>
#include <limits>

#include "base/parallel.h"

namespace tessera {

namespace {

using Corners = std::array<Vec3d, 4>;

Corners cornersFromEye(const TetMesh& mesh, std::size_t element, const Vec3d& eyeWorld) {
    Corners corners;
    for (std::size_t c = 0; c < 4; ++c)
        corners[c] = mesh.points[std::size_t(mesh.tets[element][c])] - eyeWorld;
    return corners;
}

/// @param origin from the eye.
std::optional<RaySpan> cut(const ElementPlanes& planes, const Vec3d& origin, const Vec3d& direction) {
    RaySpan span{0, std::numeric_limits<double>::infinity()};
    for (std::size_t f = 0; f < 4; ++f) {
        const double rise = glm::dot(planes.normals[f], direction);
        const double missing = planes.offsets[f] - glm::dot(planes.normals[f], origin);
        if (rise == 0 && missing > 0) return {};
        if (rise > 0) span.begin = std::max(span.begin, missing / rise);
        if (rise < 0) span.end = std::min(span.end, missing / rise);
    }
    return span.begin < span.end ? std::optional(span) : std::nullopt;
}

}  // namespace

std::optional<ElementPlanes> elementPlanes(const TetMesh& mesh, std::size_t element, const Vec3d& eyeWorld) {
    const Corners corners = cornersFromEye(mesh, element, eyeWorld);
    ElementPlanes planes;
    for (std::size_t f = 0; f < 4; ++f) {
        const Vec3d &a = corners[(f + 1) % 4], &b = corners[(f + 2) % 4], &c = corners[(f + 3) % 4];
        const Vec3d normal = glm::cross(b - a, c - a);
        const double inside = glm::dot(normal, corners[f] - a);
        if (inside == 0) return {};
        planes.normals[f] = inside < 0 ? -normal : normal;
        planes.offsets[f] = glm::dot(planes.normals[f], a);
        planes.atNodes[f] = std::abs(inside);
    }
    return planes;
}

RayElements::RayElements(const TetMesh& mesh, const Camera& camera, const Execution& execution)
    : mesh_(mesh), camera_(camera), view_(viewOf(camera)), boxes_(mesh.tets.size()) {
    parallelForChunks(execution, mesh.elementCount(), 4096, [&](std::int64_t begin, std::int64_t end) {
        for (std::size_t e = std::size_t(begin); e < std::size_t(end); ++e) boxes_[e] = pixelBox(e);
    });
}

RayElements::PixelBox RayElements::pixelBox(std::size_t element) const {
    const double w = camera_.widthPixels, h = camera_.heightPixels;
    double x0 = w, x1 = 0, y0 = h, y1 = 0, nearest = std::numeric_limits<double>::infinity();
    for (const Vec3d& p : cornersFromEye(mesh_, element, camera_.eyeWorld)) {
        const double depth = view_.isParallel ? 1 : glm::dot(p, view_.forward);
        nearest = std::min(nearest, depth);
        const double x = (glm::dot(p, view_.right) / (depth * view_.wide) + 1) * w / 2;
        const double y = (1 - glm::dot(p, view_.up) / (depth * view_.high)) * h / 2;
        x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
    }
    // One that reaches behind the eye has no such box.
    if (!(nearest > 0)) return {0, camera_.widthPixels - 1, 0, camera_.heightPixels - 1};
    const auto pixel = [](double at, double count) { return int(std::clamp(at, -1.0, count)); };
    return {std::max(pixel(x0 - 1, w), 0), std::min(pixel(x1 + 1, w), camera_.widthPixels - 1),
            std::max(pixel(y0 - 1, h), 0), std::min(pixel(y1 + 1, h), camera_.heightPixels - 1)};
}

std::vector<std::vector<ElementSpan>> RayElements::ofRow(int y) const {
    std::vector<std::vector<ElementSpan>> found(std::size_t(camera_.widthPixels));
    for (std::size_t e = 0; e < boxes_.size(); ++e) {
        const PixelBox& box = boxes_[e];
        if (y < box.y0 || y > box.y1) continue;
        const auto planes = elementPlanes(mesh_, e, camera_.eyeWorld);
        if (!planes) continue;
        for (int x = box.x0; x <= box.x1; ++x) {
            const ViewRay ray = view_.rayOf(camera_, x, y);
            if (const auto span = cut(*planes, ray.originWorld - camera_.eyeWorld, ray.direction))
                found[std::size_t(x)].push_back({*span, std::int64_t(e)});
        }
    }
    return found;
}

}  // namespace tessera
