#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// Points of a lattice along the world's axes.
struct PointGrid {
    Vec3d originWorld{0}, spacingWorld{1};
    /// An element is far from all points when its box is, on some axis, by so many spacings.
    double margin = 0;
};

/// Which elements of a mesh can touch a box or a plane, without a look at the others.
///
/// A bounding volume hierarchy over the elements in Morton order of their centres: eight elements a group,
/// eight children a node, no pointers. Boxes are kept as 32-bit floats relative to the mesh's bounds, those
/// of elements as bytes relative to their group's, both rounded outwards: about 14 bytes an element. Depends
/// on the mesh only, not on threads. Thread-safe after construction; doesn't refer to the mesh.
class ElementIndex {
  public:
    static constexpr std::size_t kEvery = ~std::size_t(0);

    ElementIndex() = default;
    explicit ElementIndex(const TetMesh& mesh, const Execution& execution = {});

    std::int64_t elementCount() const { return std::int64_t(order_.size()); }
    std::int64_t memoryBytes() const;
    /// Of the elements, world units; empty without any.
    const Box3d& boundsWorld() const { return boundsWorld_; }

    /// Appends, ascending, every element whose bounding box meets the closed box, and besides at most those
    /// whose box comes closer than 1/256 of the extent of its group of eight neighbours.
    /// Stops when there are more than `most` in the list: it is of no use then.
    /// @param grid where not null, most elements that are far from all its points are left out: small ones
    /// between the points of a coarse lattice.
    void query(const Box3d& boxWorld, std::vector<std::int32_t>& elements, std::size_t most = kEvery,
               const PointGrid* grid = nullptr) const;

    /// How many elements query() finds, or a few more: microseconds, whatever the box holds; with a grid a
    /// few nanoseconds for each point in the box.
    std::int64_t count(const Box3d& boxWorld, const PointGrid* grid = nullptr) const;

    /// The same to within a factor of 3 or so, estimated where the box cuts groups of up to 64 elements:
    /// faster.
    std::int64_t countAbout(const Box3d& boxWorld) const;

    /// Calls visit(element) for every element whose box, perhaps a little enlarged, passes meets(boxWorld),
    /// in no order. `meets` must hold for a box that holds another one for which it holds. Gives the number
    /// of elements whose boxes were looked at.
    template <class Meets, class Visit>
    std::int64_t walk(const Meets& meets, const Visit& visit) const {
        std::int64_t looked = 0;
        if (!levels_.empty()) walk(levels_.size() - 1, 0, meets, visit, looked);
        return looked;
    }

  private:
    static constexpr int kWidth = 8;
    /// Boxes of eight children, axis by axis, in shares of the mesh's bounds; absent children have none.
    struct Node {
        std::array<std::array<float, kWidth>, 3> min, max;
    };
    /// Boxes of eight elements in 256ths of their group's.
    struct Group {
        std::array<std::array<std::uint8_t, kWidth>, 3> low, high;
    };
    struct MappedBox {
        std::array<float, 3> min, max;
    };
    struct Builder;
    struct GroupSteps;
    struct Comb;

    double mapped(double x, int axis) const {
        return scale_[axis] == 0 ? 0 : (x - boundsWorld_.min[axis]) * scale_[axis];
    }
    MappedBox mapped(const Box3d& box) const;
    Box3d unmapped(const MappedBox& box) const;
    static MappedBox child(const Node& node, std::size_t c);
    /// The extents of a group's elements on an axis, perhaps a little enlarged.
    static void elementsOn(std::size_t axis, const Group& group, const MappedBox& groupBox,
                           std::array<float, kWidth>& min, std::array<float, kWidth>& max);
    /// The box in 256ths of the group's, by which its elements are compared.
    static std::array<std::uint8_t, 6> stepsWithin(const MappedBox& box, const MappedBox& group);
    /// Those below a child of a node of this level, by the child's number on the level below.
    std::span<const std::int32_t> elementsBelow(std::size_t level, std::int64_t child) const;
    /// False when the box meets no element at all.
    bool clip(const Box3d& boxWorld, MappedBox& box) const;
    void query(std::size_t level, std::int64_t node, const MappedBox& box, std::size_t most,
               std::vector<std::int32_t>& elements) const;
    static std::int64_t shareOf(std::int64_t elements, const MappedBox& below, const MappedBox& box);
    /// @param smallest subtrees of no more elements that meet the box in part count by shareOf(); 0: none do.
    std::int64_t count(std::size_t level, std::int64_t node, const MappedBox& box,
                       std::size_t smallest) const;
    template <class Visit>
    void comb(std::size_t level, std::int64_t node, const MappedBox& box, const Comb& points,
              const Visit& visit) const;

    template <class Meets, class Visit>
    void walk(std::size_t level, std::int64_t n, const Meets& meets, const Visit& visit,
              std::int64_t& looked) const {
        const Node& node = levels_[level][std::size_t(n)];
        for (std::size_t c = 0; c < kWidth; ++c) {
            if (!(node.min[0][c] <= node.max[0][c])) continue;
            const MappedBox box = child(node, c);
            if (!meets(unmapped(box))) continue;
            const std::int64_t below = n * kWidth + std::int64_t(c);
            if (level > 0) {
                walk(level - 1, below, meets, visit, looked);
                continue;
            }
            const Group& group = groups_[std::size_t(below)];
            std::array<std::array<float, kWidth>, 3> min, max;
            for (std::size_t a = 0; a < 3; ++a) elementsOn(a, group, box, min[a], max[a]);
            for (std::size_t i = 0; i < kWidth; ++i) {
                const std::size_t place = std::size_t(below) * kWidth + i;
                if (place >= order_.size()) break;
                ++looked;
                if (meets(unmapped({{min[0][i], min[1][i], min[2][i]}, {max[0][i], max[1][i], max[2][i]}})))
                    visit(order_[place]);
            }
        }
    }

    Box3d boundsWorld_;
    Vec3d scale_{0};
    std::vector<std::int32_t> order_;
    std::vector<Group> groups_;
    std::vector<std::vector<Node>> levels_;  ///< children of level 0 are groups; the last level has one node
};

/// Puts numbers that aren't negative, from place `from` on, into ascending order, each once, in time in
/// proportion to their count.
void sortEachOnce(std::vector<std::int32_t>& numbers, std::size_t from = 0);

/// The index of one mesh, built by the first who needs it; all share it. The mesh must outlive it and stay
/// unchanged.
class SharedElementIndex {
  public:
    explicit SharedElementIndex(const TetMesh& mesh) : mesh_(&mesh) {}
    const TetMesh& mesh() const { return *mesh_; }
    /// Builds it in the first call; others wait.
    const ElementIndex& get(const Execution& execution = {}) const;
    /// Null before.
    const ElementIndex* ifBuilt() const { return built_.load(std::memory_order_acquire); }

  private:
    const TetMesh* mesh_;
    mutable std::mutex mutex_;
    mutable std::unique_ptr<const ElementIndex> index_;
    mutable std::atomic<const ElementIndex*> built_{nullptr};
};

}  // namespace tessera
