#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tessera/execution.h"
#include "tessera/vec.h"

namespace tessera {

/// Linear 3D cells. Nodes are in the order of VTK's cell of the same name (a voxel's in that of vtkVoxel).
enum class CellKind : std::uint8_t { tet, pyramid, wedge, hex, voxel, polyhedron };
inline constexpr std::size_t kCellKinds = 6;

/// Number of nodes of a kind, 0 for a polyhedron.
int nodeCountOf(CellKind kind);

/// Cells of mixed kinds over common points.
struct CellList {
    std::vector<CellKind> kinds;         ///< one a cell
    std::vector<std::int64_t> begin{0};  ///< cell c is nodes[begin[c]] to nodes[begin[c + 1] - 1]
    /// Node indices. A polyhedron is its face stream: number of faces, then for each face its number of nodes
    /// and these, counter-clockwise seen from outside.
    std::vector<std::int32_t> nodes;

    std::int64_t cellCount() const { return std::int64_t(kinds.size()); }
    void add(CellKind kind, const std::int32_t* first, std::int64_t count) {
        kinds.push_back(kind);
        nodes.insert(nodes.end(), first, first + count);
        begin.push_back(std::int64_t(nodes.size()));
    }
};

/// A node that splitting added: the mean of other nodes, and so are its field values.
struct AddedNode {
    Vec3d point;
    std::vector<std::int32_t> parents;
};

struct SplitCells {
    std::vector<std::array<std::int32_t, 4>> tets;
    std::vector<std::int32_t> sourceCell;  ///< cell of every tet, ascending
    std::vector<AddedNode> addedNodes;     ///< node points.size() + i is addedNodes[i]
};

/// Splits cells into tetrahedra so that both sides of a shared face are cut alike, across blocks with
/// separate points too: a face is fanned from its node that is smallest in lexicographic order of its
/// coordinates (ties: of its index), unless its worst triangle is much better fanned from another (warped and
/// concave faces, hanging nodes). A cell is the cone from its own smallest node over the triangles that don't
/// hold it; where that inverts or flattens a tet, from another node or from its centre, which adds a node.
/// Tets keep the orientation of their cell. A wedge is upright either way, as both orders of its nodes are in
/// use (VTK's documentation has one, its shape functions and the libraries of CGNS and Exodus the other), and
/// so is a polyhedron, whose faces some readers turn inwards.
/// Tets with a repeated node are left out; other flat ones are kept.
/// @param cells every node index lies in [0, points.size()); every polyhedron's face stream is whole.
SplitCells splitCells(const std::vector<Vec3d>& points, const CellList& cells, const Execution& execution);

}  // namespace tessera
