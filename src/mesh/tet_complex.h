#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "tessera/mesh.h"

namespace tessera {

using Tet = std::array<std::int32_t, 4>;

inline bool hasNode(const Tet& tet, std::int32_t node) {
    return tet[0] == node || tet[1] == node || tet[2] == node || tet[3] == node;
}

/// A new node: a convex blend of up to four others, in place and in all point fields.
struct BlendedNode {
    Vec3d pointWorld{0};
    std::array<std::int32_t, 4> nodes{};
    std::array<double, 4> weights{};  ///< none negative, sum 1
    int count = 0;
};

/// A mesh whose elements can be exchanged, with the elements around every node. Elements and nodes keep
/// their numbers; new ones go to the end. Not thread-safe.
class TetComplex {
  public:
    /// @param mesh is taken over. Elements with a repeated node are left out at once.
    explicit TetComplex(TetMesh mesh);

    std::int32_t nodeCount() const { return std::int32_t(mesh_.points.size()); }
    std::int32_t elementCount() const { return std::int32_t(mesh_.tets.size()); }
    const Vec3d& point(std::int32_t node) const { return mesh_.points[std::size_t(node)]; }
    const Tet& tet(std::int32_t element) const { return mesh_.tets[std::size_t(element)]; }
    bool isAlive(std::int32_t element) const { return alive_[std::size_t(element)] != 0; }
    std::int64_t repeatedNodeElements() const { return repeatedNodeElements_; }

    /// Elements with this node, in no particular order; valid until the next change.
    std::span<const std::int32_t> elementsOf(std::int32_t node) const;
    /// Elements with all of these nodes (one to three), ascending.
    std::vector<std::int32_t> elementsWith(std::span<const std::int32_t> nodes) const;
    /// How many elements have this face.
    int faceUsers(const std::array<std::int32_t, 3>& face) const;

    std::int32_t addNode(const BlendedNode& node);
    /// @param parent the element whose cell values the new one takes.
    std::int32_t addElement(const Tet& tet, std::int32_t parent);
    void removeElement(std::int32_t element);
    /// Turns the element inside out.
    void flip(std::int32_t element);

    /// The living elements and the nodes that they use, in order.
    TetMesh takeMesh();

  private:
    std::vector<std::int32_t>& changeableElementsOf(std::int32_t node);

    TetMesh mesh_;
    std::vector<std::uint8_t> alive_;
    std::vector<std::int32_t> source_;  ///< of elements: whose cell values they have
    std::vector<std::int64_t> begin_;   ///< of the original nodes' lists in elements_
    std::vector<std::int32_t> elements_;
    std::unordered_map<std::int32_t, std::vector<std::int32_t>> changed_;  ///< lists that replace those
    std::int64_t repeatedNodeElements_ = 0;
};

}  // namespace tessera
