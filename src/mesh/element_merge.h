#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mesh/element_class.h"
#include "mesh/tet_complex.h"

namespace tessera {

/// A node, an edge or a face, by one to three nodes.
struct Simplex {
    std::array<std::int32_t, 3> nodes{};
    std::size_t count = 0;
    bool isIn(const Tet& tet) const;
    std::span<const std::int32_t> span() const { return {nodes.data(), count}; }
};

/// Two opposite parts of an element are pulled into one place: each part that isn't the target node itself is
/// split there (a single node moves there), and the elements that have both parts vanish. Node and node: an
/// edge collapse; node and edge, edge and edge: edges are split, then the short edge between the new nodes
/// collapses; node and face: a face is split.
struct Merge {
    Simplex first, second;
    std::int32_t target = -1;  ///< a node that is one of the parts, or -1: the blended one
    BlendedNode blended;
    double distanceWorld = 0;  ///< between the parts
};

/// What the shape's recipe asks for, in every place that the common node can have.
std::vector<Merge> recipeMerges(const Tet& tet, const Corners& corners, const ThinShape& shape);
/// All pairs of opposite parts with nearest points inside both, the closest first.
std::vector<Merge> allMerges(const Tet& tet, const Corners& corners);

/// Some elements and what replaces them.
struct Change {
    struct Added {
        Tet tet;  ///< TetComplex::nodeCount() stands for the new node
        std::int32_t parent;
    };
    std::vector<std::int32_t> removed;  ///< ascending
    std::vector<Added> added;           ///< oriented as their parents are
    bool hasNewNode = false;
    BlendedNode newNode;
};
Change changeOf(const TetComplex& complex, const Merge& merge);

}  // namespace tessera
