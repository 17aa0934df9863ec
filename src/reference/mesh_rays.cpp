#include "reference/mesh_rays.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "base/parallel.h"
#include "refine/camera_view.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Parts of a ray closer together than this share of their distance are one: elements that share a face.
constexpr double kTouching = 1e-12;

/// Pixels x0 to x1 and y0 to y1, ends included, whose rays may meet an element; none when y0 > y1.
struct PixelBox {
    int x0 = 0, x1 = 0, y0 = 0, y1 = -1;
};

using Corners = std::array<Vec3d, 4>;

Corners cornersFromEye(const TetMesh& mesh, std::size_t element, const Vec3d& eyeWorld) {
    Corners corners;
    for (std::size_t c = 0; c < 4; ++c)
        corners[c] = mesh.points[std::size_t(mesh.tets[element][c])] - eyeWorld;
    return corners;
}

PixelBox pixelBox(const Corners& corners, const Camera& camera, const CameraView& view) {
    const double w = camera.widthPixels, h = camera.heightPixels;
    double x0 = w, x1 = 0, y0 = h, y1 = 0, nearest = std::numeric_limits<double>::infinity();
    for (const Vec3d& p : corners) {
        const double depth = glm::dot(p, view.forward);
        nearest = std::min(nearest, depth);
        const double x = (glm::dot(p, view.right) / (depth * view.wide) + 1) * w / 2;
        const double y = (1 - glm::dot(p, view.up) / (depth * view.high)) * h / 2;
        x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
    }
    // One that reaches behind the eye has no such box.
    if (!(nearest > 0)) return {0, camera.widthPixels - 1, 0, camera.heightPixels - 1};
    const auto pixel = [](double at, double count) { return int(std::clamp(at, -1.0, count)); };
    return {std::max(pixel(x0 - 1, w), 0), std::min(pixel(x1 + 1, w), camera.widthPixels - 1),
            std::max(pixel(y0 - 1, h), 0), std::min(pixel(y1 + 1, h), camera.heightPixels - 1)};
}

/// An element as four half-spaces dot(normal, p) >= offset, p from the eye.
struct HalfSpaces {
    std::array<Vec3d, 4> normals;
    std::array<double, 4> offsets;
};

/// None of a flat element.
std::optional<HalfSpaces> halfSpaces(const Corners& corners) {
    HalfSpaces faces;
    for (std::size_t f = 0; f < 4; ++f) {
        const Vec3d &a = corners[(f + 1) % 4], &b = corners[(f + 2) % 4], &c = corners[(f + 3) % 4];
        Vec3d normal = glm::cross(b - a, c - a);
        const double inside = glm::dot(normal, corners[f] - a);
        if (inside == 0) return {};
        if (inside < 0) normal = -normal;
        faces.normals[f] = normal;
        faces.offsets[f] = glm::dot(normal, a);
    }
    return faces;
}

std::optional<RaySpan> cut(const HalfSpaces& faces, const Vec3d& direction) {
    RaySpan span{0, std::numeric_limits<double>::infinity()};
    for (std::size_t f = 0; f < 4; ++f) {
        const double rise = glm::dot(faces.normals[f], direction);
        if (rise == 0 && faces.offsets[f] > 0) return {};
        if (rise > 0) span.begin = std::max(span.begin, faces.offsets[f] / rise);
        if (rise < 0) span.end = std::min(span.end, faces.offsets[f] / rise);
    }
    return span.begin < span.end ? std::optional(span) : std::nullopt;
}

/// Appends the union of spans, ascending.
void appendUnion(std::vector<RaySpan>& spans, std::vector<RaySpan>& all) {
    std::sort(spans.begin(), spans.end(), [](const RaySpan& a, const RaySpan& b) {
        return a.begin != b.begin ? a.begin < b.begin : a.end < b.end;
    });
    const std::size_t first = all.size();
    for (const RaySpan& span : spans) {
        if (all.size() > first && span.begin <= all.back().end * (1 + kTouching))
            all.back().end = std::max(all.back().end, span.end);
        else
            all.push_back(span);
    }
}

}  // namespace

MeshRays::MeshRays(const TetMesh& mesh, const Camera& camera, const Execution& execution) : camera_(camera) {
    const CameraView view = viewOf(camera);
    if (view.isParallel) throw InputError("rays through a mesh start from an eye");
    std::vector<PixelBox> boxes(mesh.tets.size());
    parallelForChunks(execution, mesh.elementCount(), 4096, [&](std::int64_t begin, std::int64_t end) {
        for (std::size_t e = std::size_t(begin); e < std::size_t(end); ++e)
            boxes[e] = pixelBox(cornersFromEye(mesh, e, camera.eyeWorld), camera, view);
    });
    rows_.resize(std::size_t(camera.heightPixels));
    parallelFor(execution, camera.heightPixels, [&](std::int64_t y) {
        std::vector<std::vector<RaySpan>> found(std::size_t(camera.widthPixels));
        for (std::size_t e = 0; e < boxes.size(); ++e) {
            const PixelBox& box = boxes[e];
            if (y < box.y0 || y > box.y1) continue;
            const auto faces = halfSpaces(cornersFromEye(mesh, e, camera.eyeWorld));
            if (!faces) continue;
            for (int x = box.x0; x <= box.x1; ++x)
                if (const auto span = cut(*faces, view.rayOf(camera, x, int(y)).direction))
                    found[std::size_t(x)].push_back(*span);
        }
        Row& row = rows_[std::size_t(y)];
        for (std::vector<RaySpan>& spans : found) {
            row.first.push_back(row.spans.size());
            appendUnion(spans, row.spans);
        }
        row.first.push_back(row.spans.size());
    });
}

std::int64_t MeshRays::pixelCount() const {
    std::int64_t count = 0;
    for (const Row& row : rows_)
        for (std::size_t x = 0; x + 1 < row.first.size(); ++x) count += row.first[x] < row.first[x + 1];
    return count;
}

}  // namespace tessera
