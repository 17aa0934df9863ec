#include "surface/size_field.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/text.h"
#include "mesh/triangle_distance.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

/// Normals of the points, by the areas of the triangles around.
std::vector<Vec3d> pointNormals(const Surface& surface) {
    std::vector<Vec3d> normals(surface.points.size(), Vec3d(0));
    for (const auto& t : surface.triangles) {
        const Vec3d& a = surface.points[std::size_t(t[0])];
        const Vec3d normal =
            glm::cross(surface.points[std::size_t(t[1])] - a, surface.points[std::size_t(t[2])] - a);
        for (const std::int32_t corner : t) normals[std::size_t(corner)] += normal;
    }
    for (Vec3d& normal : normals) {
        const double length = glm::length(normal);
        normal = length > 0 ? normal / length : Vec3d(0);
    }
    return normals;
}

const Field& sizeField(const Surface& surface, const std::string& name) {
    std::string there;
    for (const Field& field : surface.fields) {
        if (field.name == name) {
            if (field.components == 1) return field;
            throw InputError("--size-field: '" + name + "' has " + std::to_string(field.components) +
                             " components, expected one length");
        }
        there += (there.empty() ? "" : ", ") + field.name;
    }
    throw InputError("--size-field: there is no field '" + name +
                     "'; there are: " + (there.empty() ? "none" : there));
}

}  // namespace

std::vector<double> curvatureRadii(const Surface& surface) {
    const std::vector<Vec3d> normals = pointNormals(surface);
    std::vector<double> radii(surface.points.size(), kFar);
    for (const auto& t : surface.triangles) {
        for (std::size_t i = 0; i < 3; ++i) {
            const auto a = std::size_t(t[i]), b = std::size_t(t[(i + 1) % 3]);
            const double turned = glm::length(normals[a] - normals[b]);  // 2 sin(angle / 2)
            const double length = glm::length(surface.points[a] - surface.points[b]);
            if (!(turned > 1e-9)) continue;
            radii[a] = std::min(radii[a], length / turned);
            radii[b] = std::min(radii[b], length / turned);
        }
    }
    return radii;
}

SizeField::SizeField(const Surface& surface, const SizeWishes& wishes, const Execution& execution)
    : everywhere_(wishes.everywhere > 0 ? wishes.everywhere : kFar),
      growth_(wishes.growth),
      least_(everywhere_) {
    if (!wishes.hasSurface()) return;
    sizes_.assign(surface.points.size(), wishes.atSurface > 0 ? wishes.atSurface : kFar);
    if (!wishes.field.empty()) {
        const Field& field = sizeField(surface, wishes.field);
        for (std::size_t p = 0; p < sizes_.size(); ++p) {
            if (!(field.values[p] > 0))
                throw InputError("--size-field: '" + wishes.field + "' is " + exactText(field.values[p]) +
                                 " at point " + std::to_string(p) + ", expected lengths above 0");
            sizes_[p] = std::min(sizes_[p], field.values[p]);
        }
    }
    if (wishes.edgesPerCircle > 0) {
        const std::vector<double> radii = curvatureRadii(surface);
        for (std::size_t p = 0; p < sizes_.size(); ++p)
            sizes_[p] = std::min(sizes_[p], 2 * std::numbers::pi * radii[p] / wishes.edgesPerCircle);
    }
    for (double& size : sizes_) {
        size = std::max(size, wishes.smallest);
        least_ = std::min(least_, size);
    }
    buildTree(surface, execution);
}

void SizeField::buildTree(const Surface& surface, const Execution& execution) {
    std::vector<Box3d> boxes(surface.triangles.size());
    for (std::size_t t = 0; t < boxes.size(); ++t)
        for (const std::int32_t corner : surface.triangles[t])
            boxes[t].include(surface.points[std::size_t(corner)]);
    tree_ = BoxTree(boxes, execution);
    for (const std::int32_t t : tree_.order()) {
        auto& corners = corners_.emplace_back();
        auto& sizes = cornerSizes_.emplace_back();
        for (std::size_t i = 0; i < 3; ++i) {
            const auto corner = std::size_t(surface.triangles[std::size_t(t)][i]);
            corners[i] = surface.points[corner];
            sizes[i] = sizes_[corner];
        }
    }
    std::vector<double> below;
    for (const auto& sizes : cornerSizes_) below.push_back(std::min({sizes[0], sizes[1], sizes[2]}));
    for (int level = 0; level < tree_.levelCount(); ++level) {
        auto& nodes = leastBelow_.emplace_back((below.size() + BoxTree::kWidth - 1) / BoxTree::kWidth);
        std::vector<double> ofNodes;
        for (std::size_t n = 0; n < nodes.size(); ++n) {
            nodes[n].fill(kFar);
            for (std::size_t c = 0; c < BoxTree::kWidth && BoxTree::kWidth * n + c < below.size(); ++c)
                nodes[n][c] = below[BoxTree::kWidth * n + c];
            ofNodes.push_back(*std::min_element(nodes[n].begin(), nodes[n].end()));
        }
        below = std::move(ofNodes);
    }
}

/// The least over all triangles, of those that can have one below `most`.
double SizeField::nearSurface(const Vec3d& placeWorld, double most) const {
    struct Pending {
        double least;
        int level;
        std::int64_t index;
    };
    // Four children a level, at most 16 levels over 2^31 triangles.
    std::array<Pending, 64> stack;
    std::size_t pending = 0;
    stack[pending++] = {0, tree_.levelCount() - 1, 0};
    while (pending > 0) {
        const Pending current = stack[--pending];
        if (current.least >= most) continue;
        const BoxTree::Node& node = tree_.node(current.level, current.index);
        const auto& least = leastBelow_[std::size_t(current.level)][std::size_t(current.index)];
        std::array<Pending, BoxTree::kWidth> children;
        for (std::size_t c = 0; c < BoxTree::kWidth; ++c) {
            Vec3d away{0};
            for (std::size_t k = 0; k < 3; ++k) {
                const double p = placeWorld[int(k)];
                away[int(k)] = std::max({node.min[k][c] - p, p - node.max[k][c], 0.0});
            }
            children[c] = {least[c] + growth_ * glm::length(away), current.level - 1,
                           current.index * BoxTree::kWidth + std::int64_t(c)};
            if (!(children[c].least < most)) children[c].least = kFar;  // an absent one, too
        }
        std::sort(children.begin(), children.end(),
                  [](const Pending& a, const Pending& b) { return a.least > b.least; });
        for (const Pending& child : children) {
            if (!(child.least < most)) continue;
            if (current.level > 0) {
                stack[pending++] = child;
                continue;
            }
            const TrianglePlace place = nearestOnTriangle(corners_[std::size_t(child.index)], placeWorld);
            double size = growth_ * std::sqrt(place.distance2);
            for (std::size_t i = 0; i < 3; ++i)
                if (place.weights[i] > 0)
                    size += place.weights[i] * cornerSizes_[std::size_t(child.index)][i];
            most = std::min(most, size);
        }
    }
    return most;
}

double SizeField::at(const Vec3d& placeWorld) const {
    return sizes_.empty() ? everywhere_ : nearSurface(placeWorld, everywhere_);
}

}  // namespace tessera
