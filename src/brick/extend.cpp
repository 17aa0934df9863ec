#include "brick/extend.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <glm/vector_relational.hpp>
#include <memory>
#include <optional>
#include <string>
#include <unordered_set>

#include "base/floor_div.h"
#include "base/parallel.h"
#include "brick/closed_coverage.h"
#include "brick/overlap.h"
#include "tessera/error.h"
#include "tessera/lattice.h"

namespace tessera {

namespace {

constexpr std::int64_t kElementChunk = 4096;
// A cell counts as touched within this many voxels: more than a place in it can be off by rounding.
constexpr double kTouchSlack = 1.0 / 1024;

/// The points of a leaf's closed box: which are covered, and which others touched cells need.
class ClosedBox {
  public:
    /// @param covered of ClosedCoverage.
    ClosedBox(const BrickTree& tree, std::size_t leaf, const std::vector<std::uint8_t>& covered)
        : edge_(tree.brickCells() + 1),
          first_(tree.ownedPoints(tree.leaves()[leaf]).min),
          covered_(words(), 0),
          needed_(words(), 0) {
        for (std::size_t i = 0; i < covered.size(); ++i) {
            if (covered[i])
                set(covered_, i);
            else
                complete_ = false;
        }
    }
    bool isComplete() const { return complete_; }

    /// Marks what is missing at the corners of the cell. False when nothing new is.
    bool needs(const Vec3i& cell) const {
        for (int c = 0; c < 8; ++c) {
            const std::size_t i = at(cell + cornerOffset(c));
            if (!has(covered_, i) && !has(needed_, i)) return true;
        }
        return false;
    }
    void need(const Vec3i& cell) {
        for (int c = 0; c < 8; ++c) {
            const std::size_t i = at(cell + cornerOffset(c));
            if (has(covered_, i)) continue;
            std::atomic_ref<std::uint64_t>(needed_[i >> 6])
                .fetch_or(std::uint64_t(1) << (i & 63), std::memory_order_relaxed);
        }
    }
    template <class Visit>
    void forEachNeeded(const Visit& visit) const {
        for (int z = 0; z < edge_; ++z)
            for (int y = 0; y < edge_; ++y)
                for (int x = 0; x < edge_; ++x)
                    if (has(needed_, at({x, y, z}))) visit(first_ + Vec3i(x, y, z));
    }

  private:
    std::size_t words() const {
        return (std::size_t(edge_) * std::size_t(edge_) * std::size_t(edge_) + 63) / 64;
    }
    std::size_t at(const Vec3i& p) const {
        return (std::size_t(p.z) * std::size_t(edge_) + std::size_t(p.y)) * std::size_t(edge_) +
               std::size_t(p.x);
    }
    static void set(std::vector<std::uint64_t>& bits, std::size_t i) {
        bits[i >> 6] |= std::uint64_t(1) << (i & 63);
    }
    static bool has(const std::vector<std::uint64_t>& bits, std::size_t i) {
        auto& word = const_cast<std::uint64_t&>(bits[i >> 6]);
        return (std::atomic_ref<std::uint64_t>(word).load(std::memory_order_relaxed) >> (i & 63)) & 1;
    }

    int edge_;
    Vec3i first_;
    bool complete_ = true;
    std::vector<std::uint64_t> covered_, needed_;
};

/// Face planes of an element: most cells beside it are told apart by these alone.
struct FacePlanes {
    std::array<Vec3d, 4> normal;
    std::array<double, 4> offset;  // n . p <= offset inside
    std::array<double, 4> reach;   // of a cell around its centre, along the normal

    explicit FacePlanes(const std::array<Vec3d, 4>& p) {
        for (std::size_t i = 0; i < 4; ++i) {
            const Vec3d &a = p[(i + 1) & 3], &b = p[(i + 2) & 3], &c = p[(i + 3) & 3];
            normal[i] = glm::cross(b - a, c - a);
            if (glm::dot(normal[i], p[i] - a) > 0) normal[i] = -normal[i];
            offset[i] = glm::dot(normal[i], a);
            const Vec3d size = glm::abs(normal[i]);
            // The tolerance covers the rounding of normals and products, for any shape.
            const double scale =
                (size.x + size.y + size.z) * (1 + glm::length(a)) + glm::length(b - a) * glm::length(c - a);
            reach[i] = (0.5 + kTouchSlack) * (size.x + size.y + size.z) + 1e-12 * scale;
        }
    }
    bool surelyOutside(const Vec3d& cellCentre) const {
        for (std::size_t i = 0; i < 4; ++i)
            if (glm::dot(normal[i], cellCentre) > offset[i] + reach[i]) return true;
        return false;
    }
};

/// Finds the extension's points.
class Extender {
  public:
    Extender(const TetMesh& mesh, const BrickTree& tree, BrickStore& store,
             const Reconstruction& reconstruction, const KeptPoints& kept, const Execution& execution)
        : mesh_(mesh),
          tree_(tree),
          store_(store),
          reconstruction_(reconstruction),
          kept_(kept),
          execution_(execution),
          coverage_(tree, store, reconstruction, execution) {}

    /// What cells that the mesh touches need.
    void markNeeded() {
        boxes_.resize(tree_.leafCount());
        parallelFor(execution_, std::int64_t(boxes_.size()), [&](std::int64_t i) {
            if (coverage_.isSurelyWhole(std::size_t(i))) return;
            auto box = std::make_unique<ClosedBox>(tree_, std::size_t(i), coverage_.of(std::size_t(i)));
            if (!box->isComplete()) boxes_[std::size_t(i)] = std::move(box);
        });
        parallelForChunks(execution_, mesh_.elementCount(), kElementChunk,
                          [&](std::int64_t begin, std::int64_t end) {
                              std::vector<std::size_t> leaves;
                              for (std::int64_t e = begin; e < end; ++e) markElement(e, leaves);
                          });
        std::vector<std::vector<BrickKey>> found(boxes_.size());  // a level and a lattice point each
        parallelFor(execution_, std::int64_t(boxes_.size()), [&](std::int64_t i) {
            if (!boxes_[std::size_t(i)]) return;
            const int level = tree_.leaves()[std::size_t(i)].level;
            boxes_[std::size_t(i)]->forEachNeeded([&](const Vec3i& p) {
                reconstruction_.visitOutside(level, p, [&](int ownerLevel, const Vec3i& point) {
                    if (kept_.keeps(ownerLevel, point)) found[std::size_t(i)].push_back({ownerLevel, point});
                });
            });
        });
        boxes_.clear();
        for (const auto& points : found)
            for (const BrickKey& p : points) mark(p.level, p.index);
    }

    /// All points within some layers of the covered ones, or one less of those marked, of the same level.
    void markLayers(int layers);

    void fill(const ExtensionValues& values) {
        std::vector<std::pair<TileKey, Tile*>> tiles;
        for (auto& [key, tile] : store_.extension()) tiles.emplace_back(key, &tile);
        const std::size_t channels = std::size_t(store_.channels());
        parallelFor(execution_, std::int64_t(tiles.size()), [&](std::int64_t t) {
            const auto& [key, tile] = tiles[std::size_t(t)];
            tile->values = std::make_unique<float[]>(channels * kTilePoints);
            std::vector<double> value(channels);
            for (int offset = 0; offset < kTilePoints; ++offset) {
                if (!tile->covered(offset)) continue;
                values(key.level, key.index * kTileSize + pointInTile(offset), value);
                for (std::size_t c = 0; c < channels; ++c)
                    tile->values[c * kTilePoints + std::size_t(offset)] = float(value[c]);
            }
        });
    }

  private:
    void mark(int level, const Vec3i& p) {
        store_.extension()[{level, floorDiv(p, kTileSize)}].cover(offsetInTile(p));
    }

    void markElement(std::int64_t e, std::vector<std::size_t>& leaves) {
        prefetchNodes(mesh_, std::min(e + kPrefetchElements, mesh_.elementCount() - 1));
        const auto nodes0 = elementInIndexSpace(mesh_, e, tree_.originWorld(), tree_.spacingWorld(0));
        Box3d bounds0;
        for (const Vec3d& node : nodes0) bounds0.include(node);
        // A cell of the coarsest level may be touched from outside its leaf by that level's slack.
        const double slack0 = std::ldexp(kTouchSlack, tree_.levelCount());
        leaves.clear();
        tree_.findLeavesIn({bounds0.min - slack0, bounds0.max + slack0}, leaves);
        int level = -1;
        std::optional<ElementOverlap> element;
        std::optional<FacePlanes> planes;
        for (const std::size_t leaf : leaves) {
            ClosedBox* box = boxes_[leaf].get();
            if (!box) continue;
            if (tree_.leaves()[leaf].level != level) {
                level = tree_.leaves()[leaf].level;
                std::array<Vec3d, 4> nodes = nodes0;
                for (Vec3d& node : nodes) node *= std::ldexp(1.0, -level);
                element.emplace(nodes);
                planes.emplace(nodes);
            }
            markCells(*element, *planes, tree_.ownedPoints(tree_.leaves()[leaf]), *box);
        }
    }

    static void markCells(const ElementOverlap& element, const FacePlanes& planes, const IndexBox& cells,
                          ClosedBox& box) {
        const Vec3d first(cells.min), last(cells.max - 1);
        const Vec3d lowest = glm::floor(element.bounds().min - kTouchSlack),
                    highest = glm::floor(element.bounds().max + kTouchSlack);
        if (glm::any(glm::greaterThan(lowest, last)) || glm::any(glm::lessThan(highest, first))) return;
        const Vec3i low(glm::max(lowest, first)), high(glm::min(highest, last));
        for (int x = low.x; x <= high.x; ++x)
            for (int y = low.y; y <= high.y; ++y)
                for (int z = low.z; z <= high.z; ++z) {
                    const Vec3i cell = Vec3i(x, y, z);
                    if (!box.needs(cell - cells.min) || planes.surelyOutside(Vec3d(cell) + 0.5)) continue;
                    if (element.touches({Vec3d(cell) - kTouchSlack, Vec3d(cell) + (1 + kTouchSlack)}))
                        box.need(cell - cells.min);
                }
    }

    const TetMesh& mesh_;
    const BrickTree& tree_;
    BrickStore& store_;
    const Reconstruction& reconstruction_;
    const KeptPoints& kept_;
    const Execution& execution_;
    const ClosedCoverage coverage_;
    std::vector<std::unique_ptr<ClosedBox>> boxes_;  // one a leaf; null where every point is covered
};

// Bricks that layers may lie in: the leaves, and what lies next to a leaf of the level and isn't a coarser
// leaf's.
std::vector<BrickKey> targetBricks(const BrickTree& tree) {
    std::unordered_set<BrickKey, BrickKeyHash> keys;
    for (const BrickKey& leaf : tree.leaves())
        for (int n = 0; n < 27; ++n) {
            const BrickKey near{leaf.level, leaf.index + Vec3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)};
            const std::int64_t covering = tree.findCovering(near);
            if (covering >= 0 && tree.leaves()[std::size_t(covering)].level != leaf.level) continue;
            keys.insert(near);
        }
    std::vector<BrickKey> sorted(keys.begin(), keys.end());
    std::sort(sorted.begin(), sorted.end(), inStorageOrder);
    return sorted;
}

// Marks of one brick and a border around it, one byte a point, x fastest.
class LayerWindow {
  public:
    LayerWindow(const BrickTree& tree, const BrickStore& store, const BrickKey& key, int layers)
        : layers_(layers),
          brickCells_(tree.brickCells()),
          edge_(brickCells_ + 2 * layers),
          marks_(std::size_t(edge_) * std::size_t(edge_) * std::size_t(edge_), 0) {
        const int n = store.tilesPerEdge();
        for (int near = 0; near < 27; ++near) {
            const Vec3i step(near % 3 - 1, near / 3 % 3 - 1, near / 9 - 1);
            const std::int64_t leaf = tree.findLeaf({key.level, key.index + step});
            if (leaf < 0) continue;
            for (int t = 0; t < store.tileCount(); ++t)
                if (const Tile* tile = store.tile(std::size_t(leaf), t))
                    include(*tile, step * brickCells_ + Vec3i(t / (n * n), t / n % n, t % n) * kTileSize);
        }
        covered_ = marks_;
    }
    bool empty() const { return !any_; }
    bool isNew(const Vec3i& local) const {
        const std::size_t i = at(local + layers_);
        return marks_[i] != 0 && covered_[i] == 0;
    }
    /// @param first the tile's first point, counted from the brick's.
    void include(const Tile& tile, const Vec3i& first) {
        const Vec3i low = glm::max(Vec3i(0), -layers_ - first);
        const Vec3i high = glm::min(Vec3i(kTileSize), brickCells_ + layers_ - first);
        for (int x = low.x; x < high.x; ++x)
            for (int y = low.y; y < high.y; ++y)
                for (int z = low.z; z < high.z; ++z) {
                    if (!tile.covered((x * 8 + y) * 8 + z)) continue;
                    marks_[at(first + Vec3i(x, y, z) + layers_)] = 1;
                    any_ = true;
                }
    }
    /// Marks every point within `steps` (26 neighbours) of a marked one: three passes, one an axis.
    void grow(int steps) {
        if (steps <= 0) return;
        const std::size_t edge = std::size_t(edge_);
        const std::array<std::size_t, 3> stride{1, edge, edge * edge};
        for (std::size_t axis = 0; axis < 3; ++axis)
            for (std::size_t a = 0; a < edge; ++a)
                for (std::size_t b = 0; b < edge; ++b) {
                    const std::size_t first = a * stride[(axis + 1) % 3] + b * stride[(axis + 2) % 3];
                    growLine(first, stride[axis], steps);
                }
    }

  private:
    std::size_t at(const Vec3i& p) const {
        return (std::size_t(p.z) * std::size_t(edge_) + std::size_t(p.y)) * std::size_t(edge_) +
               std::size_t(p.x);
    }

    // Forwards by the distance to the last mark, then backwards to the next one.
    void growLine(std::size_t first, std::size_t stride, int steps) {
        line_.resize(std::size_t(edge_));
        int distance = steps;
        for (int i = 0; i < edge_; ++i) {
            const std::uint8_t mark = marks_[first + std::size_t(i) * stride];
            line_[std::size_t(i)] = mark;
            distance = mark ? 0 : distance + 1;
            if (distance <= steps) marks_[first + std::size_t(i) * stride] = 1;
        }
        distance = steps;
        for (int i = edge_ - 1; i >= 0; --i) {
            distance = line_[std::size_t(i)] ? 0 : distance + 1;
            if (distance <= steps) marks_[first + std::size_t(i) * stride] = 1;
        }
    }

    int layers_, brickCells_, edge_;
    bool any_ = false;
    std::vector<std::uint8_t> marks_, covered_, line_;
};

void Extender::markLayers(int layers) {
    const std::vector<BrickKey> targets = targetBricks(tree_);
    std::vector<std::vector<Vec3i>> points(targets.size());
    const int b = tree_.brickCells();
    parallelFor(execution_, std::int64_t(targets.size()), [&](std::int64_t t) {
        const BrickKey& key = targets[std::size_t(t)];
        const std::int64_t leaf = tree_.findLeaf(key);
        if (leaf >= 0 && coverage_.isFull(std::size_t(leaf))) return;
        LayerWindow window(tree_, store_, key, layers);
        window.grow(1);
        const Vec3i first = key.index * b;
        const Vec3i low = floorDiv(first - layers, kTileSize),
                    high = floorDiv(first + (b - 1) + layers, kTileSize);
        for (int x = low.x; x <= high.x; ++x)
            for (int y = low.y; y <= high.y; ++y)
                for (int z = low.z; z <= high.z; ++z) {
                    const auto found = store_.extension().find({key.level, {x, y, z}});
                    if (found != store_.extension().end())
                        window.include(found->second, Vec3i(x, y, z) * kTileSize - first);
                }
        if (window.empty()) return;
        window.grow(layers - 1);
        const bool shared = tree_.isRefined(key);
        for (int z = 0; z < b; ++z)
            for (int y = 0; y < b; ++y)
                for (int x = 0; x < b; ++x) {
                    const Vec3i local(x, y, z);
                    if (!window.isNew(local) || !kept_.keeps(key.level, first + local)) continue;
                    if (shared && tree_.findLeafAt(key.level, first + local) >= 0)
                        continue;  // a finer leaf's own
                    points[std::size_t(t)].push_back(first + local);
                }
    });
    for (std::size_t t = 0; t < targets.size(); ++t)
        for (const Vec3i& p : points[t]) mark(targets[t].level, p);
}

}  // namespace

void extendOutside(const TetMesh& mesh, const BrickTree& tree, BrickStore& store,
                   const Reconstruction& reconstruction, const KeptPoints& kept, int layers,
                   const ExtensionValues& values, const Execution& execution) {
    if (layers < 0 || layers > tree.brickCells())
        throw InputError("the number of layers outside the mesh must be 0 to the brick size, not " +
                         std::to_string(layers));
    store.extension().clear();
    if (layers == 0) return;
    Extender extender(mesh, tree, store, reconstruction, kept, execution);
    extender.markNeeded();
    extender.markLayers(layers);
    extender.fill(values);
}

}  // namespace tessera
