#include "mesh/split_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <utility>

#include "base/check.h"
#include "base/large_pages.h"
#include "base/parallel.h"
#include "mesh/geometry.h"
#include "mesh/tet_complex.h"

namespace tessera {

namespace {

using Triangle = std::array<std::int32_t, 3>;

constexpr std::int64_t kCellChunk = 1 << 12;

/// A fan is good when no triangle of it leans away from the face's normal by more than about 37 degrees, and
/// its worst triangle isn't much smaller than that of the best fan. (On a snappyHexMesh mesh of warped octree
/// cells, fans that lean fold their cells over.)
constexpr double kLeastCosine = 0.8;
constexpr double kLeastShare = 0.05;

/// Starts of a fan and apexes of a cone that are tried: more than the cells of any mesher have nodes. In a
/// damaged file a cell may have a million, and trying all would take the square of that.
constexpr std::size_t kMostTried = 256;

/// A face of a fixed kind of cell: local nodes counter-clockwise seen from outside.
struct LocalFace {
    int count;
    std::array<int, 4> nodes;
};

constexpr std::array<LocalFace, 5> kPyramidFaces{
    {{4, {0, 3, 2, 1}}, {3, {0, 1, 4, 0}}, {3, {1, 2, 4, 0}}, {3, {2, 3, 4, 0}}, {3, {3, 0, 4, 0}}}};
constexpr std::array<LocalFace, 5> kWedgeFaces{
    {{3, {0, 1, 2, 0}}, {3, {3, 5, 4, 0}}, {4, {0, 3, 4, 1}}, {4, {1, 4, 5, 2}}, {4, {2, 5, 3, 0}}}};
constexpr std::array<LocalFace, 6> kHexFaces{{{4, {0, 4, 7, 3}},
                                              {4, {1, 2, 6, 5}},
                                              {4, {0, 1, 5, 4}},
                                              {4, {3, 7, 6, 2}},
                                              {4, {0, 3, 2, 1}},
                                              {4, {4, 5, 6, 7}}}};
constexpr std::array<LocalFace, 6> kVoxelFaces{{{4, {0, 4, 6, 2}},
                                                {4, {1, 3, 7, 5}},
                                                {4, {0, 1, 5, 4}},
                                                {4, {2, 6, 7, 3}},
                                                {4, {0, 2, 3, 1}},
                                                {4, {4, 5, 7, 6}}}};

std::span<const LocalFace> facesOf(CellKind kind) {
    switch (kind) {
        case CellKind::pyramid:
            return kPyramidFaces;
        case CellKind::wedge:
            return kWedgeFaces;
        case CellKind::hex:
            return kHexFaces;
        case CellKind::voxel:
            return kVoxelFaces;
        default:
            return {};
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
        grazing_.clear();
        if (kind == CellKind::polyhedron) {
            fanPolyhedron(nodes);
        } else {
            nodes_.assign(nodes.begin(), nodes.end());
            for (const LocalFace& face : facesOf(kind)) {
                polygon_.clear();
                for (int i = 0; i < face.count; ++i)
                    polygon_.push_back(nodes[std::size_t(face.nodes[std::size_t(i)])]);
                fanPolygon();
            }
        }
        coneTriangles(kind);
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

    std::size_t chooseFanStart() const;
    void fanPolygon();
    void fanPolyhedron(std::span<const std::int32_t> stream);
    void orientFaces(std::vector<std::vector<std::int32_t>>& faces) const;
    void coneTriangles(CellKind kind);
    void turnTriangles() {
        for (Triangle& triangle : triangles_) std::swap(triangle[1], triangle[2]);
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

    /// Smallest and largest sign among the tets of the cone from `apex`; `node` is its index, or -1.
    std::pair<int, int> coneSigns(const Vec3d& apex, std::int32_t node) const {
        std::pair<int, int> signs{1, -1};
        for (const Triangle& t : triangles_) {
            if (t[0] == node || t[1] == node || t[2] == node) continue;
            const int sign = volumeSign(place(t[0]), place(t[2]), place(t[1]), apex);
            signs = {std::min(signs.first, sign), std::max(signs.second, sign)};
            if (signs == std::pair(-1, 1)) break;
        }
        return signs;
    }

    /// Mean of the cell's nodes; finite where they are.
    Vec3d centreOfNodes() const {
        const auto count = double(nodes_.size());
        Vec3d sum(0);
        for (const std::int32_t node : nodes_) sum += place(node) - place(nodes_[0]);
        const Vec3d centre = place(nodes_[0]) + sum / count;
        if (std::isfinite(centre.x) && std::isfinite(centre.y) && std::isfinite(centre.z)) return centre;
        // A difference left the range of double: parts of the places, with larger rounding, don't.
        Vec3d mean(0);
        Box3d box;
        for (const std::int32_t node : nodes_) {
            mean += place(node) / count;
            box.include(place(node));
        }
        return glm::clamp(mean, box.min, box.max);
    }

    /// Six times the signed volume inside the triangles.
    double volumeInside(const Vec3d& centre) const {
        double sum = 0;
        for (const Triangle& t : triangles_)
            sum += glm::dot(glm::cross(place(t[0]) - centre, place(t[1]) - centre), place(t[2]) - centre);
        return sum;
    }

    const std::vector<Vec3d>& points_;
    std::int32_t cell_ = 0;
    std::vector<std::int32_t> nodes_;    // of the cell
    std::vector<std::int32_t> polygon_;  // one face
    std::vector<std::int32_t>
        grazing_;                      // nodes that see a triangle of one of their own faces, mostly edge-on
    std::vector<Triangle> triangles_;  // of all faces, counter-clockwise seen from outside
};

/// The position in polygon_ that its triangles are fanned from: the smallest node if its fan is good, else
/// the node whose worst triangle is largest. A triangle's share is its area seen along the face's normal:
/// negative when it is folded over, as at a concave corner, 0 at a hanging node. Both cells at the face come
/// to the same choice bit for bit, because all is computed from the smallest node towards its smaller
/// neighbour.
std::size_t Splitter::chooseFanStart() const {
    const std::size_t n = polygon_.size();
    std::size_t smallest = 0;
    for (std::size_t i = 1; i < n; ++i)
        if (before(polygon_[i], polygon_[smallest])) smallest = i;
    if (n == 3) return smallest;
    const std::size_t step =
        before(polygon_[(smallest + 1) % n], polygon_[(smallest + n - 1) % n]) ? 1 : n - 1;
    const auto corner = [&](std::size_t k) -> const Vec3d& {
        return place(polygon_[(smallest + k * step) % n]);
    };
    const auto triangleNormal = [&](std::size_t start, std::size_t i) {
        const Vec3d& a = corner(start);
        return glm::cross(corner(start + i) - a, corner(start + i + 1) - a);
    };
    Vec3d normal(0);
    for (std::size_t i = 1; i + 1 < n; ++i) normal += triangleNormal(0, i);
    const double area2 = glm::dot(normal, normal);
    const auto worstShare = [&](std::size_t start, double& worstCosine2) {
        double worst = std::numeric_limits<double>::infinity();
        for (std::size_t i = 1; i + 1 < n; ++i) {
            const Vec3d triangle = triangleNormal(start, i);
            const double share = glm::dot(triangle, normal);
            worst = std::min(worst, share);
            worstCosine2 =
                std::min(worstCosine2, share * std::fabs(share) / (glm::dot(triangle, triangle) * area2));
        }
        return worst;
    };
    double smallestCosine2 = 1, unused = 1;
    const double smallestShare = worstShare(0, smallestCosine2);
    double bestShare = smallestShare;
    std::size_t best = 0;
    // Opposite nodes of a quad give the same fan.
    for (std::size_t k = 1; k < (n == 4 ? 2 : std::min(n, kMostTried)); ++k) {
        const double share = worstShare(k, unused);
        if (share <= bestShare) continue;
        best = k;
        bestShare = share;
    }
    const bool good =
        smallestCosine2 >= kLeastCosine * kLeastCosine && smallestShare >= kLeastShare * bestShare;
    return good ? smallest : (smallest + best * step) % n;
}

void Splitter::fanPolygon() {
    const std::size_t n = polygon_.size();
    if (n < 3) return;
    const std::size_t start = chooseFanStart();
    for (std::size_t i = 1; i + 1 < n; ++i) {
        const Triangle triangle{polygon_[start], polygon_[(start + i) % n], polygon_[(start + i + 1) % n]};
        if (triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[0] != triangle[2])
            triangles_.push_back(triangle);
    }
    for (std::size_t i = 0; i < n; ++i) {
        const bool inEveryTriangle = n == 3 || i == start || (n == 4 && i == (start + 2) % n);
        if (!inEveryTriangle) grazing_.push_back(polygon_[i]);
    }
}

/// Emits the cone over the faces' triangles from the first of these that serves: a node, in coordinate order,
/// from which every tet has the sign of the cell and none grazes a face; the centre; a node from which some
/// tets are slivers, then flat; for a polyhedron the centre whatever it does; the smallest node as it is.
void Splitter::coneTriangles(CellKind kind) {
    if (triangles_.empty()) return;
    const bool isPolyhedron = kind == CellKind::polyhedron;
    const bool eitherWay = isPolyhedron || kind == CellKind::wedge;
    const auto smaller = [&](std::int32_t a, std::int32_t b) { return before(a, b); };
    const auto grazes = [&](std::int32_t node) {
        return std::find(grazing_.begin(), grazing_.end(), node) != grazing_.end();
    };
    const std::int32_t smallest = *std::min_element(nodes_.begin(), nodes_.end(), smaller);
    const auto smallestSigns = coneSigns(place(smallest), smallest);
    if (smallestSigns.first * smallestSigns.second > 0 && !grazes(smallest)) {
        if (eitherWay && smallestSigns.first < 0) turnTriangles();
        emitCone(smallest);
        return;
    }
    std::sort(nodes_.begin(), nodes_.end(), smaller);
    nodes_.erase(std::unique(nodes_.begin(), nodes_.end()), nodes_.end());
    const Vec3d centre = centreOfNodes();
    double volume = volumeInside(centre);
    if (eitherWay && volume < 0) {
        turnTriangles();
        volume = -volume;
    }
    const auto allKeepSign = [&](std::pair<int, int> signs) {
        return volume < 0 ? signs.second < 0 : signs.first > 0;
    };
    const auto noneInverted = [&](std::pair<int, int> signs) {
        return volume < 0 ? signs.second <= 0 : signs.first >= 0;
    };

    std::int32_t withSlivers = -1, withFlat = -1;
    for (const std::int32_t node : std::span(nodes_).first(std::min(nodes_.size(), kMostTried))) {
        const auto signs = coneSigns(place(node), node);
        if (allKeepSign(signs) && !grazes(node)) {
            emitCone(node);
            return;
        }
        if (withSlivers < 0 && allKeepSign(signs)) withSlivers = node;
        if (withFlat < 0 && noneInverted(signs)) withFlat = node;
    }
    const auto centreSigns = coneSigns(centre, -1);
    const bool nodeServes = withSlivers >= 0 || withFlat >= 0;
    if (allKeepSign(centreSigns) || (!nodeServes && (isPolyhedron || noneInverted(centreSigns)))) {
        const auto added = std::int32_t(points_.size() + result.addedNodes.size());
        result.addedNodes.push_back({centre, nodes_});
        emitCone(added);
        return;
    }
    emitCone(withSlivers >= 0 ? withSlivers : withFlat >= 0 ? withFlat : smallest);
}

/// Makes neighbouring faces run through their common edge in opposite directions: not every writer does. The
/// majority of the faces keep their direction.
void Splitter::orientFaces(std::vector<std::vector<std::int32_t>>& faces) const {
    std::map<std::pair<std::int32_t, std::int32_t>, std::vector<std::size_t>> facesOfEdge;
    const auto forEachEdge = [&](std::size_t f, const auto& visit) {
        for (std::size_t i = 0; i < faces[f].size(); ++i)
            visit(faces[f][i], faces[f][(i + 1) % faces[f].size()]);
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
                std::vector<std::size_t>& there = facesOfEdge[std::minmax(a, b)];
                for (const std::size_t g : there) {
                    if (state[g] != unseen) continue;
                    const bool sameDirection = runsThrough(g, a, b);
                    state[g] = sameDirection == (state[f] == kept) ? turned : kept;
                    component.push_back(g);
                }
                there.clear();  // all of them are seen now
            });
        }
        const auto turnedCount = std::count_if(component.begin(), component.end(),
                                               [&](std::size_t f) { return state[f] == turned; });
        const char toTurn = 2 * turnedCount > std::ptrdiff_t(component.size()) ? kept : turned;
        for (const std::size_t f : component)
            if (state[f] == toTurn) std::reverse(faces[f].begin(), faces[f].end());
    }
}

void Splitter::fanPolyhedron(std::span<const std::int32_t> stream) {
    std::vector<std::vector<std::int32_t>> faces;
    nodes_.clear();
    std::size_t at = 1;
    for (std::int32_t f = 0; f < stream[0]; ++f) {
        const auto count = std::size_t(stream[at]);
        const auto first = stream.begin() + std::ptrdiff_t(at) + 1;
        faces.emplace_back(first, first + std::ptrdiff_t(count));
        nodes_.insert(nodes_.end(), faces.back().begin(), faces.back().end());
        at += 1 + count;
    }
    orientFaces(faces);
    for (const auto& face : faces) {
        polygon_ = face;
        fanPolygon();
    }
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
        case CellKind::tet:
            return 4;
        case CellKind::pyramid:
            return 5;
        case CellKind::wedge:
            return 6;
        case CellKind::hex:
        case CellKind::voxel:
            return 8;
        case CellKind::polyhedron:
            break;
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
            splitter.split(cells.kinds[std::size_t(c)], {cells.nodes.data() + first, last - first},
                           std::int32_t(c));
        }
        parts[std::size_t(chunk)] = std::move(splitter.result);
    });
    SplitCells all;
    std::size_t tetCount = 0;
    for (const SplitCells& part : parts) tetCount += part.tets.size();
    reserveLarge(all.tets, tetCount);
    all.sourceCell.reserve(tetCount);
    for (SplitCells& part : parts) append(all, part, points.size());
    return all;
}

}  // namespace tessera
