#include "mesh/split_cells.h"

#include <algorithm>
#include <limits>
#include <map>
#include <span>
#include <utility>

#include "base/error.h"
#include "mesh/geometry.h"

namespace tessera {

namespace {

using Triangle = std::array<std::int32_t, 3>;
using Tet = std::array<std::int32_t, 4>;

constexpr std::int64_t kCellChunk = 1 << 12;

/// A face of a fixed kind of cell: local nodes counter-clockwise seen from outside.
struct LocalFace {
    int count;
    std::array<int, 4> nodes;
};

constexpr std::array<LocalFace, 5> kPyramidFaces{
    {{4, {0, 3, 2, 1}}, {3, {0, 1, 4, 0}}, {3, {1, 2, 4, 0}}, {3, {2, 3, 4, 0}}, {3, {3, 0, 4, 0}}}};
constexpr std::array<LocalFace, 5> kWedgeFaces{
    {{3, {0, 1, 2, 0}}, {3, {3, 5, 4, 0}}, {4, {0, 3, 4, 1}}, {4, {1, 4, 5, 2}}, {4, {2, 5, 3, 0}}}};
constexpr std::array<LocalFace, 6> kHexFaces{
    {{4, {0, 4, 7, 3}}, {4, {1, 2, 6, 5}}, {4, {0, 1, 5, 4}}, {4, {3, 7, 6, 2}}, {4, {0, 3, 2, 1}}, {4, {4, 5, 6, 7}}}};
constexpr std::array<LocalFace, 6> kVoxelFaces{
    {{4, {0, 4, 6, 2}}, {4, {1, 3, 7, 5}}, {4, {0, 1, 5, 4}}, {4, {2, 6, 7, 3}}, {4, {0, 2, 3, 1}}, {4, {4, 5, 7, 6}}}};

std::span<const LocalFace> facesOf(CellKind kind) {
    switch (kind) {
        case CellKind::pyramid: return kPyramidFaces;
        case CellKind::wedge: return kWedgeFaces;
        case CellKind::hex: return kHexFaces;
        case CellKind::voxel: return kVoxelFaces;
        default: return {};
    }
}

/// Splits cells one after the other into its own lists; added nodes are numbered from points.size() on.
class Splitter {
  public:
    explicit Splitter(const std::vector<Vec3d>& points) : points_(points) {}

    SplitCells result;

    void split(CellKind kind, std::span<const std::int32_t> nodes, std::int32_t cell) {
        cell_ = cell;
        if (kind == CellKind::tet) {
            emit({nodes[0], nodes[1], nodes[2], nodes[3]});
            return;
        }
        triangles_.clear();
        if (kind == CellKind::polyhedron) {
            splitPolyhedron(nodes);
            return;
        }
        for (const LocalFace& face : facesOf(kind)) {
            std::array<std::int32_t, 4> polygon{};
            for (std::size_t i = 0; i < std::size_t(face.count); ++i) polygon[i] = nodes[std::size_t(face.nodes[i])];
            fanPolygon({polygon.data(), std::size_t(face.count)});
        }
        emitCone(*std::min_element(nodes.begin(), nodes.end(), [&](auto a, auto b) { return before(a, b); }));
    }

  private:
    bool before(std::int32_t a, std::int32_t b) const {
        const Vec3d& p = points_[std::size_t(a)];
        const Vec3d& q = points_[std::size_t(b)];
        if (p.x != q.x) return p.x < q.x;
        if (p.y != q.y) return p.y < q.y;
        if (p.z != q.z) return p.z < q.z;
        return a < b;
    }

    void fanPolygon(std::span<const std::int32_t> polygon) {
        std::size_t start = 0;
        for (std::size_t i = 1; i < polygon.size(); ++i)
            if (before(polygon[i], polygon[start])) start = i;
        for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
            const Triangle triangle{polygon[start], polygon[(start + i) % polygon.size()],
                                    polygon[(start + i + 1) % polygon.size()]};
            if (triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[0] != triangle[2])
                triangles_.push_back(triangle);
        }
    }

    void emit(const Tet& tet) {
        for (std::size_t i = 0; i < 4; ++i)
            for (std::size_t j = i + 1; j < 4; ++j)
                if (tet[i] == tet[j]) return;
        result.tets.push_back(tet);
        result.sourceCell.push_back(cell_);
    }

    static Tet coneTet(const Triangle& triangle, std::int32_t apex) {
        return {triangle[0], triangle[2], triangle[1], apex};
    }

    void emitCone(std::int32_t apex) {
        for (const Triangle& triangle : triangles_) emit(coneTet(triangle, apex));
    }

    const Vec3d& place(std::int32_t node) const { return points_[std::size_t(node)]; }

    /// True when no tet of the cone from `apex` has the opposite sign of the cell.
    bool coneKeepsSign(const Vec3d& apex, int cellSign) const {
        return std::all_of(triangles_.begin(), triangles_.end(), [&](const Triangle& t) {
            return volumeSign(place(t[0]), place(t[2]), place(t[1]), apex) * cellSign >= 0;
        });
    }

    /// Six times the signed volume inside the triangles.
    double volumeInside(const Vec3d& centre) const {
        double sum = 0;
        for (const Triangle& t : triangles_)
            sum += glm::dot(glm::cross(place(t[0]) - centre, place(t[1]) - centre), place(t[2]) - centre);
        return sum;
    }

    void splitPolyhedron(std::span<const std::int32_t> stream);
    void orientFaces(std::vector<std::vector<std::int32_t>>& faces) const;

    const std::vector<Vec3d>& points_;
    std::int32_t cell_ = 0;
    std::vector<Triangle> triangles_;
};

/// Makes neighbouring faces run through their common edge in opposite directions: not every writer does. The majority of
/// the faces keep their direction.
void Splitter::orientFaces(std::vector<std::vector<std::int32_t>>& faces) const {
    std::map<std::pair<std::int32_t, std::int32_t>, std::vector<std::size_t>> facesOfEdge;
    const auto forEachEdge = [&](std::size_t f, const auto& visit) {
        for (std::size_t i = 0; i < faces[f].size(); ++i) visit(faces[f][i], faces[f][(i + 1) % faces[f].size()]);
    };
    for (std::size_t f = 0; f < faces.size(); ++f)
        forEachEdge(f, [&](std::int32_t a, std::int32_t b) { facesOfEdge[std::minmax(a, b)].push_back(f); });
    const auto runsThrough = [&](std::size_t f, std::int32_t a, std::int32_t b) {
        bool found = false;
        forEachEdge(f, [&](std::int32_t c, std::int32_t d) { found = found || (a == c && b == d); });
        return found;
    };
    enum : char { unseen, kept, turned };
    std::vector<char> state(faces.size(), unseen);
    for (std::size_t seed = 0; seed < faces.size(); ++seed) {
        if (state[seed] != unseen) continue;
        std::vector<std::size_t> component{seed};
        state[seed] = kept;
        for (std::size_t next = 0; next < component.size(); ++next) {
            const std::size_t f = component[next];
            forEachEdge(f, [&](std::int32_t a, std::int32_t b) {
                for (const std::size_t g : facesOfEdge[std::minmax(a, b)]) {
                    if (state[g] != unseen) continue;
                    const bool sameDirection = runsThrough(g, a, b);
                    state[g] = sameDirection == (state[f] == kept) ? turned : kept;
                    component.push_back(g);
                }
            });
        }
        const auto turnedCount = std::count_if(component.begin(), component.end(),
                                               [&](std::size_t f) { return state[f] == turned; });
        const char toTurn = 2 * turnedCount > std::ptrdiff_t(component.size()) ? kept : turned;
        for (const std::size_t f : component)
            if (state[f] == toTurn) std::reverse(faces[f].begin(), faces[f].end());
    }
}

void Splitter::splitPolyhedron(std::span<const std::int32_t> stream) {
    std::vector<std::vector<std::int32_t>> faces;
    std::vector<std::int32_t> nodes;
    std::size_t at = 1;
    for (std::int32_t f = 0; f < stream[0]; ++f) {
        const auto count = std::size_t(stream[at]);
        const auto first = stream.begin() + std::ptrdiff_t(at) + 1;
        faces.emplace_back(first, first + std::ptrdiff_t(count));
        nodes.insert(nodes.end(), faces.back().begin(), faces.back().end());
        at += 1 + count;
    }
    if (nodes.empty()) return;
    orientFaces(faces);
    for (const auto& face : faces) fanPolygon(face);
    std::sort(nodes.begin(), nodes.end(), [&](auto a, auto b) { return before(a, b); });
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());

    Vec3d centre(0);
    for (const std::int32_t node : nodes) centre += place(node) - place(nodes[0]);
    centre = place(nodes[0]) + centre / double(nodes.size());
    const int cellSign = volumeInside(centre) < 0 ? -1 : 1;
    for (const std::int32_t node : nodes) {
        if (!coneKeepsSign(place(node), cellSign)) continue;
        emitCone(node);
        return;
    }
    const auto added = std::int32_t(points_.size() + result.addedNodes.size());
    result.addedNodes.push_back({centre, nodes});
    emitCone(added);
}

/// Appends the lists of one chunk; its added nodes come after those of the chunks before.
void append(SplitCells& all, SplitCells& part, std::size_t pointCount) {
    const auto shift = std::int32_t(all.addedNodes.size());
    if (shift > 0 && !part.addedNodes.empty())
        for (Tet& tet : part.tets)
            for (std::int32_t& node : tet)
                if (std::size_t(node) >= pointCount) node += shift;
    all.tets.insert(all.tets.end(), part.tets.begin(), part.tets.end());
    all.sourceCell.insert(all.sourceCell.end(), part.sourceCell.begin(), part.sourceCell.end());
    std::move(part.addedNodes.begin(), part.addedNodes.end(), std::back_inserter(all.addedNodes));
    part = {};
}

}  // namespace

int nodeCountOf(CellKind kind) {
    switch (kind) {
        case CellKind::tet: return 4;
        case CellKind::pyramid: return 5;
        case CellKind::wedge: return 6;
        case CellKind::hex:
        case CellKind::voxel: return 8;
        case CellKind::polyhedron: break;
    }
    return 0;
}

SplitCells splitCells(const std::vector<Vec3d>& points, const CellList& cells, const Execution& execution) {
    TESSERA_CHECK(cells.begin.size() == cells.kinds.size() + 1, "one end a cell");
    const std::int64_t count = cells.cellCount();
    const std::int64_t chunks = (count + kCellChunk - 1) / kCellChunk;
    std::vector<SplitCells> parts{std::size_t(chunks)};
    parallelFor(execution, chunks, [&](std::int64_t chunk) {
        Splitter splitter(points);
        const std::int64_t end = std::min(count, (chunk + 1) * kCellChunk);
        splitter.result.tets.reserve(std::size_t(end - chunk * kCellChunk));
        splitter.result.sourceCell.reserve(std::size_t(end - chunk * kCellChunk));
        for (std::int64_t c = chunk * kCellChunk; c < end; ++c) {
            const auto first = std::size_t(cells.begin[std::size_t(c)]);
            const auto last = std::size_t(cells.begin[std::size_t(c) + 1]);
            splitter.split(cells.kinds[std::size_t(c)], {cells.nodes.data() + first, last - first}, std::int32_t(c));
        }
        parts[std::size_t(chunk)] = std::move(splitter.result);
    });
    SplitCells all;
    std::size_t tetCount = 0;
    for (const SplitCells& part : parts) tetCount += part.tets.size();
    all.tets.reserve(tetCount);
    all.sourceCell.reserve(tetCount);
    for (SplitCells& part : parts) append(all, part, points.size());
    return all;
}

}  // namespace tessera
