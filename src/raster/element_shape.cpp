#include "raster/element_shape.h"

#include <algorithm>
#include <cmath>

#include "index_space/exact_scan.h"
#include "raster/regions.h"

namespace tessera {

namespace {

double lengthOf(const double (&v)[3]) {
    return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

void placeNodes(const TetMesh& mesh, const NodeFrame& frame, std::int32_t element, ElementShape& shape) {
    const auto& tet = mesh.tets[std::size_t(element)];
    const NodeFrame::Node* nodes[4];
    for (std::size_t k = 0; k < 4; ++k) nodes[k] = &frame.nodes[std::size_t(tet[k])];
    for (int a = 0; a < 3; ++a) {
        const double first =
            std::min({nodes[0]->whole[a], nodes[1]->whole[a], nodes[2]->whole[a], nodes[3]->whole[a]});
        shape.first[a] = int(std::clamp(first, -0x1p31, 0x1p31 - 1));
        for (int k = 0; k < 4; ++k) {
            // Beyond 2^53 voxels nothing is left for the rest, which then is rounding alone.
            const double part = std::fabs(nodes[k]->whole[a]) < 0x1p53 ? nodes[k]->part[a] : 0;
            shape.node[k][a] = (nodes[k]->whole[a] - first) + part;
        }
        shape.low[a] = std::min({shape.node[0][a], shape.node[1][a], shape.node[2][a], shape.node[3][a]});
        shape.high[a] = std::max({shape.node[0][a], shape.node[1][a], shape.node[2][a], shape.node[3][a]});
    }
}

/// Largest displacement in voxels that rounding may cause in a face plane within the element's box; infinity
/// when a face or the element is too thin for double.
double setUpFaces(ElementShape& shape) {
    double size = 0;
    for (int a = 0; a < 3; ++a) size = std::max(size, shape.high[a] - shape.low[a]);
    double worst = 0;
    for (int face = 0; face < 4; ++face) {
        const double(&a)[3] = shape.node[(face + 1) & 3];
        const double(&b)[3] = shape.node[(face + 2) & 3];
        const double(&c)[3] = shape.node[(face + 3) & 3];
        double p[3], q[3], n[3];
        for (int i = 0; i < 3; ++i) {
            p[i] = b[i] - a[i];
            q[i] = c[i] - a[i];
        }
        for (int i = 0; i < 3; ++i) n[i] = p[(i + 1) % 3] * q[(i + 2) % 3] - p[(i + 2) % 3] * q[(i + 1) % 3];
        // Scale first: the squares of a tiny normal would underflow.
        const double largest = std::max({std::fabs(n[0]), std::fabs(n[1]), std::fabs(n[2])});
        if (!(largest > 0)) return INFINITY;
        for (double& x : n) x /= largest;
        const double length = lengthOf(n);
        worst = std::max(worst, kPlaneRounding * size * size * (size + 1) / (largest * length));
        double inner = 0, at = 0;
        for (int i = 0; i < 3; ++i) inner += n[i] * (shape.node[face][i] - a[i]);
        for (int i = 0; i < 3; ++i) {
            shape.normal[face][i] = (inner < 0 ? -n[i] : n[i]) / length;
            at += shape.normal[face][i] * a[i];
        }
        shape.offset[face] = -at;
        shape.height[face] = std::fabs(inner) / length;
    }
    return worst;
}

/// How far, for each voxel that all face planes move outwards, a corner of the element moves: 3 in a regular
/// tetrahedron, without bound in thin ones. The moved planes bound the convex hull of the moved corners, so
/// no point between them is further from the element.
double cornerReach(const ElementShape& shape) {
    double inverse[4];
    for (int j = 0; j < 4; ++j) inverse[j] = 1 / shape.height[j];
    double most = 0;
    for (int i = 0; i < 4; ++i) {
        double moved[3] = {0, 0, 0};
        for (int j = 0; j < 4; ++j)
            for (int a = 0; a < 3; ++a) moved[a] += (shape.node[i][a] - shape.node[j][a]) * inverse[j];
        most = std::max(most, moved[0] * moved[0] + moved[1] * moved[1] + moved[2] * moved[2]);
    }
    return std::sqrt(most);
}

}  // namespace

IndexBox pointsAbout(const ElementShape& shape, const IndexBox& box) {
    IndexBox points;
    const double room = kBoxSlack + shape.margin;
    for (int a = 0; a < 3; ++a) {
        const double low = double(shape.first[a]) + std::ceil(shape.low[a] - room);
        const double high = double(shape.first[a]) + std::floor(shape.high[a] + room);
        points.min[a] = int(std::clamp(low, double(box.min[a]), double(box.max[a])));
        points.max[a] = int(std::clamp(high + 1, double(box.min[a]), double(box.max[a])));
    }
    return points;
}

ElementShape shapeElement(const TetMesh& mesh, const NodeFrame& frame, std::int32_t element) {
    ElementShape shape;
    placeNodes(mesh, frame, element, shape);
    const double planeError = setUpFaces(shape);
    if (!(planeError < kMostPlaneError)) return shape;
    const double thinnest = std::min({shape.height[0], shape.height[1], shape.height[2], shape.height[3]});
    if (!(thinnest > 8 * planeError) || thinnest > kLargestHeight) return shape;
    const double reach = kCornerFactor * cornerReach(shape);
    // Places in a fragment are at most a cell's edge from the point that coefficients are relative to.
    double size = 0, farthest = 0;
    for (int a = 0; a < 3; ++a) size = std::max(size, shape.high[a] - shape.low[a]);
    for (int face = 0; face < 4; ++face) farthest = std::max(farthest, shape.height[face]);
    const double arm = std::min(size, double(kCellEdge)) + 1;
    const double inFloat = kFloatRounding * arm + kFloatUnit * farthest + planeError;
    const double inDouble = 2 * planeError;
    if (2 * inFloat * reach <= kLargestMargin) {
        shape.grade = ShapeGrade::easy;
        shape.slack = inFloat;
    } else if (2 * inDouble * reach <= kLargestMargin) {
        shape.grade = ShapeGrade::thin;
        shape.slack = inDouble;
    }
    shape.margin = 2 * shape.slack * reach;
    return shape;
}

}  // namespace tessera
