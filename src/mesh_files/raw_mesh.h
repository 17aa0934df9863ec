#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "mesh/split_cells.h"
#include "mesh_files/read_mesh.h"

namespace tessera {

/// One array of a file, read or not.
struct ArrayInfo {
    std::string name;
    FieldLocation location = FieldLocation::point;
    int components = 1;
    bool numeric = true;
};

/// One block of a file before splitting.
struct RawBlock {
    std::size_t part = 0;  ///< which of a mesh's files it comes from, see ReadOptions::otherParts
    std::vector<Vec3d> points;
    /// the file's number of every point, where blocks share points; else empty
    std::vector<std::int64_t> nodeIds;
    CellList cells;  ///< 3D cells that take part; node indices and face streams are checked
    /// In place of `cells`, where every cell of the block is a tetrahedron of four different nodes.
    std::vector<std::array<std::int32_t, 4>> tets;
    /// position of each of these cells in the block; empty when it is the same
    std::vector<std::int64_t> sourceCell;
    std::int64_t sourceCells = 0;   ///< cells of the block of any kind
    std::vector<Field> fields;      ///< point: a tuple for every point; cell: one for every source cell
    std::vector<ArrayInfo> arrays;  ///< all arrays there are, asked for or not

    std::int64_t cellCount() const { return tets.empty() ? cells.cellCount() : std::int64_t(tets.size()); }
};

/// A mesh before splitting.
struct RawMesh {
    std::vector<RawBlock> blocks;
    /// what the reader of the format counts: cells, skipped, blanked, higher order, warnings
    ImportStatistics statistics;
};

/// What a message calls the mesh: its file, and how many other parts it has.
std::string meshName(const std::string& path, const ReadOptions& options);

/// The name under which a cell field is known when a point field has the same one.
std::string cellFieldName(const std::string& name);

/// Whether the options ask for an array of this name and place.
bool isWanted(const ReadOptions& options, const std::string& name, FieldLocation location);

}  // namespace tessera
