#include "mesh/tet_complex.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/check.h"
#include "mesh/field_range.h"

namespace tessera {

namespace {

bool hasRepeatedNode(const Tet& t) {
    return t[0] == t[1] || t[0] == t[2] || t[0] == t[3] || t[1] == t[2] || t[1] == t[3] || t[2] == t[3];
}

/// Within the range of the values blended; NaN when one of them isn't finite, unless all are the same.
double blend(const Field& field, int component, const BlendedNode& node) {
    double sum = 0;
    ValueRange range;
    bool allFinite = true;
    for (int i = 0; i < node.count; ++i) {
        const double weight = node.weights[std::size_t(i)];
        if (!(weight > 0)) continue;
        const double value = field.at(node.nodes[std::size_t(i)], component);
        allFinite = allFinite && std::isfinite(value);
        range.min = std::min(range.min, value);
        range.max = std::max(range.max, value);
        sum += weight * value;
    }
    if (range.min == range.max) return range.min;
    if (!allFinite) return std::numeric_limits<double>::quiet_NaN();
    return std::clamp(sum, range.min, range.max);
}

}  // namespace

TetComplex::TetComplex(TetMesh mesh)
    : mesh_(std::move(mesh)), alive_(mesh_.tets.size(), 1), begin_(mesh_.points.size() + 1) {
    for (std::size_t e = 0; e < mesh_.tets.size(); ++e) {
        if (hasRepeatedNode(mesh_.tets[e])) {
            alive_[e] = 0;
            ++repeatedNodeElements_;
            continue;
        }
        for (const std::int32_t node : mesh_.tets[e]) ++begin_[std::size_t(node) + 1];
    }
    for (std::size_t n = 1; n < begin_.size(); ++n) begin_[n] += begin_[n - 1];
    elements_.resize(std::size_t(begin_.back()));
    std::vector<std::int64_t> cursor(begin_.begin(), begin_.end() - 1);
    for (std::size_t e = 0; e < mesh_.tets.size(); ++e)
        if (alive_[e])
            for (const std::int32_t node : mesh_.tets[e])
                elements_[std::size_t(cursor[std::size_t(node)]++)] = std::int32_t(e);
    source_.resize(mesh_.tets.size());
    for (std::size_t e = 0; e < source_.size(); ++e) source_[e] = std::int32_t(e);
}

std::span<const std::int32_t> TetComplex::elementsOf(std::int32_t node) const {
    const auto found = changed_.find(node);
    if (found != changed_.end()) return found->second;
    const auto n = std::size_t(node);
    if (n + 1 >= begin_.size()) return {};
    return std::span(elements_).subspan(std::size_t(begin_[n]), std::size_t(begin_[n + 1] - begin_[n]));
}

std::vector<std::int32_t> TetComplex::elementsWith(std::span<const std::int32_t> nodes) const {
    std::vector<std::int32_t> found;
    for (const std::int32_t e : elementsOf(nodes[0]))
        if (std::all_of(nodes.begin() + 1, nodes.end(), [&](std::int32_t n) { return hasNode(tet(e), n); }))
            found.push_back(e);
    std::sort(found.begin(), found.end());
    return found;
}

int TetComplex::faceUsers(const std::array<std::int32_t, 3>& face) const {
    int users = 0;
    for (const std::int32_t e : elementsOf(face[0]))
        users += hasNode(tet(e), face[1]) && hasNode(tet(e), face[2]);
    return users;
}

std::vector<std::int32_t>& TetComplex::changeableElementsOf(std::int32_t node) {
    const auto found = changed_.find(node);
    if (found != changed_.end()) return found->second;
    const auto list = elementsOf(node);
    return changed_.emplace(node, std::vector<std::int32_t>(list.begin(), list.end())).first->second;
}

std::int32_t TetComplex::addNode(const BlendedNode& node) {
    TESSERA_CHECK(nodeCount() < std::numeric_limits<std::int32_t>::max(), "too many nodes");
    for (Field& field : mesh_.fields) {
        if (field.location != FieldLocation::point) continue;
        for (int c = 0; c < field.components; ++c) field.values.push_back(blend(field, c, node));
    }
    mesh_.points.push_back(node.pointWorld);
    return nodeCount() - 1;
}

std::int32_t TetComplex::addElement(const Tet& tet, std::int32_t parent) {
    TESSERA_CHECK(elementCount() < std::numeric_limits<std::int32_t>::max(), "too many elements");
    const std::int32_t element = elementCount();
    mesh_.tets.push_back(tet);
    alive_.push_back(1);
    source_.push_back(source_[std::size_t(parent)]);
    for (const std::int32_t node : tet) changeableElementsOf(node).push_back(element);
    return element;
}

void TetComplex::removeElement(std::int32_t element) {
    TESSERA_CHECK(isAlive(element), "an element is removed once");
    alive_[std::size_t(element)] = 0;
    for (const std::int32_t node : tet(element)) std::erase(changeableElementsOf(node), element);
}

void TetComplex::flip(std::int32_t element) {
    auto& tet = mesh_.tets[std::size_t(element)];
    std::swap(tet[2], tet[3]);
}

TetMesh TetComplex::takeMesh() {
    TetMesh mesh;
    std::vector<std::int32_t> newIndex(mesh_.points.size(), -1);
    for (std::size_t e = 0; e < mesh_.tets.size(); ++e)
        if (alive_[e])
            for (const std::int32_t node : mesh_.tets[e]) newIndex[std::size_t(node)] = 0;
    for (std::size_t n = 0; n < newIndex.size(); ++n) {
        if (newIndex[n] < 0) continue;
        newIndex[n] = std::int32_t(mesh.points.size());
        mesh.points.push_back(mesh_.points[n]);
    }
    for (const Field& field : mesh_.fields)
        mesh.fields.push_back({field.name, field.location, field.components, {}});
    const auto append = [&](FieldLocation location, std::int64_t item) {
        for (std::size_t f = 0; f < mesh.fields.size(); ++f)
            if (mesh.fields[f].location == location)
                for (int c = 0; c < mesh.fields[f].components; ++c)
                    mesh.fields[f].values.push_back(mesh_.fields[f].at(item, c));
    };
    for (std::size_t n = 0; n < newIndex.size(); ++n)
        if (newIndex[n] >= 0) append(FieldLocation::point, std::int64_t(n));
    for (std::size_t e = 0; e < mesh_.tets.size(); ++e) {
        if (!alive_[e]) continue;
        Tet tet = mesh_.tets[e];
        for (std::int32_t& node : tet) node = newIndex[std::size_t(node)];
        mesh.tets.push_back(tet);
        append(FieldLocation::cell, source_[e]);
    }
    mesh_ = {};
    return mesh;
}

}  // namespace tessera
