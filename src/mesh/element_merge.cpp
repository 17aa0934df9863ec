#include "mesh/element_merge.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace tessera {

namespace {

/// Nearest points at the rim of a part belong to a smaller part.
constexpr double kInside = 1e-9;

bool isInside(double weight) {
    return weight > kInside && weight < 1 - kInside;
}

using Places = std::array<std::uint8_t, 4>;

Simplex simplexOf(const Tet& tet, std::initializer_list<std::uint8_t> places) {
    Simplex simplex;
    for (const std::uint8_t i : places) simplex.nodes[simplex.count++] = tet[i];
    return simplex;
}

/// A node of the element at a blend of its corners.
BlendedNode blendOf(const Tet& tet, const Corners& c, const std::array<double, 4>& weights) {
    BlendedNode node;
    double largest = -1;
    std::size_t heaviest = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        if (!(weights[i] > 0)) continue;
        if (weights[i] > largest) largest = weights[i], heaviest = i;
        node.nodes[std::size_t(node.count)] = tet[i];
        node.weights[std::size_t(node.count++)] = weights[i];
    }
    // Relative to the heaviest corner, so that a large offset costs no digits.
    Vec3d shift{0};
    for (std::size_t i = 0; i < 4; ++i)
        if (weights[i] > 0) shift += weights[i] * (c[i] - c[heaviest]);
    node.pointWorld = c[heaviest] + shift;
    return node;
}

void addNodeToNode(const Tet& tet, const Corners& c, std::uint8_t i, std::uint8_t j,
                   std::vector<Merge>& merges) {
    Merge merge{simplexOf(tet, {i}), simplexOf(tet, {j}), -1, {}, glm::distance(c[i], c[j])};
    for (const std::uint8_t target : {i, j}) {
        merge.target = tet[target];
        merges.push_back(merge);
    }
}

void addNodeToEdge(const Tet& tet, const Corners& c, std::uint8_t node, std::uint8_t i, std::uint8_t j,
                   std::vector<Merge>& merges) {
    const Vec3d edge = c[j] - c[i], offset = c[node] - c[i];
    const double t = glm::dot(offset, edge) / glm::dot(edge, edge);
    if (!isInside(t)) return;
    std::array<double, 4> weights{};
    weights[i] = 1 - t;
    weights[j] = t;
    Merge merge{
        simplexOf(tet, {node}), simplexOf(tet, {i, j}), tet[node], {}, glm::length(offset - t * edge)};
    merges.push_back(merge);
    merge.target = -1;
    merge.blended = blendOf(tet, c, weights);
    merges.push_back(merge);
}

void addEdgeToEdge(const Tet& tet, const Corners& c, const Places& p, std::vector<Merge>& merges) {
    const Vec3d u = c[p[1]] - c[p[0]], v = c[p[3]] - c[p[2]], w = c[p[2]] - c[p[0]];
    const double uu = glm::dot(u, u), vv = glm::dot(v, v), uv = glm::dot(u, v);
    const double determinant = uu * vv - uv * uv;
    if (!(determinant > 1e-12 * uu * vv)) return;
    const double s = (glm::dot(w, u) * vv - glm::dot(w, v) * uv) / determinant;
    const double t = (glm::dot(w, u) * uv - glm::dot(w, v) * uu) / determinant;
    if (!isInside(s) || !isInside(t)) return;
    Merge merge{
        simplexOf(tet, {p[0], p[1]}), simplexOf(tet, {p[2], p[3]}), -1, {}, glm::length(w + t * v - s * u)};
    for (const double share : {1.0, 0.0, 0.5}) {  // on the first edge, on the second, between them
        std::array<double, 4> weights{};
        weights[p[0]] = share * (1 - s);
        weights[p[1]] = share * s;
        weights[p[2]] = (1 - share) * (1 - t);
        weights[p[3]] = (1 - share) * t;
        merge.blended = blendOf(tet, c, weights);
        merges.push_back(merge);
    }
}

void addNodeToFace(const Tet& tet, const Corners& c, const Places& p, std::vector<Merge>& merges) {
    const Vec3d u = c[p[2]] - c[p[1]], v = c[p[3]] - c[p[1]], w = c[p[0]] - c[p[1]];
    const Vec3d normal = glm::cross(u, v);
    const double area2 = glm::dot(normal, normal);
    const double t2 = glm::dot(glm::cross(w, v), normal) / area2;
    const double t3 = glm::dot(glm::cross(u, w), normal) / area2;
    const double t1 = 1 - t2 - t3;
    if (!isInside(t1) || !isInside(t2) || !isInside(t3)) return;
    std::array<double, 4> weights{};
    weights[p[1]] = t1;
    weights[p[2]] = t2;
    weights[p[3]] = t3;
    Merge merge{simplexOf(tet, {p[0]}),
                simplexOf(tet, {p[1], p[2], p[3]}),
                tet[p[0]],
                {},
                std::fabs(glm::dot(w, normal)) / std::sqrt(area2)};
    merges.push_back(merge);
    merge.target = -1;
    merge.blended = blendOf(tet, c, weights);
    merges.push_back(merge);
}

bool isTarget(const Simplex& part, std::int32_t target) {
    return part.count == 1 && part.nodes[0] == target;
}

}  // namespace

bool Simplex::isIn(const Tet& tet) const {
    for (std::size_t i = 0; i < count; ++i)
        if (!hasNode(tet, nodes[i])) return false;
    return true;
}

std::vector<Merge> recipeMerges(const Tet& tet, const Corners& c, const ThinShape& shape) {
    std::vector<Merge> merges;
    const Places& p = shape.order;
    switch (shape.shape) {
        case ElementClass::needle:
            addNodeToNode(tet, c, p[0], p[1], merges);
            break;
        case ElementClass::sliver:
            addEdgeToEdge(tet, c, p, merges);
            break;
        case ElementClass::cap:
            addNodeToFace(tet, c, p, merges);
            break;
        default: {  // spindle: the node of the large angle's edge that is nearer to the opposite edge
            std::vector<Merge> other;
            addNodeToEdge(tet, c, p[0], p[2], p[3], merges);
            addNodeToEdge(tet, c, p[1], p[2], p[3], other);
            if (merges.empty() || (!other.empty() && other[0].distanceWorld < merges[0].distanceWorld))
                merges = std::move(other);
        }
    }
    return merges;
}

std::vector<Merge> allMerges(const Tet& tet, const Corners& c) {
    std::vector<Merge> merges;
    for (std::uint8_t i = 0; i < 4; ++i) {
        for (std::uint8_t j = std::uint8_t(i + 1); j < 4; ++j) {
            addNodeToNode(tet, c, i, j, merges);
            for (std::uint8_t node = 0; node < 4; ++node)
                if (node != i && node != j) addNodeToEdge(tet, c, node, i, j, merges);
        }
        const auto others = [&](std::size_t k) { return std::uint8_t((i + k) % 4); };
        addNodeToFace(tet, c, {i, others(1), others(2), others(3)}, merges);
    }
    addEdgeToEdge(tet, c, {0, 1, 2, 3}, merges);
    addEdgeToEdge(tet, c, {0, 2, 1, 3}, merges);
    addEdgeToEdge(tet, c, {0, 3, 1, 2}, merges);
    std::stable_sort(merges.begin(), merges.end(),
                     [](const Merge& a, const Merge& b) { return a.distanceWorld < b.distanceWorld; });
    return merges;
}

Change changeOf(const TetComplex& complex, const Merge& merge) {
    Change change;
    change.hasNewNode = merge.target < 0;
    change.newNode = merge.blended;
    const std::int32_t target = change.hasNewNode ? complex.nodeCount() : merge.target;
    std::vector<std::int32_t> ofFirst, ofSecond;
    if (!isTarget(merge.first, target)) ofFirst = complex.elementsWith(merge.first.span());
    if (!isTarget(merge.second, target)) ofSecond = complex.elementsWith(merge.second.span());
    std::set_union(ofFirst.begin(), ofFirst.end(), ofSecond.begin(), ofSecond.end(),
                   std::back_inserter(change.removed));
    for (const std::int32_t e : change.removed) {
        const Tet& tet = complex.tet(e);
        const bool isFirst = merge.first.isIn(tet);
        if (isFirst && merge.second.isIn(tet)) continue;
        for (const std::int32_t node : (isFirst ? merge.first : merge.second).span()) {
            Tet child = tet;
            *std::find(child.begin(), child.end(), node) = target;
            change.added.push_back({child, e});
        }
    }
    return change;
}

}  // namespace tessera
