#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/read_mesh.h"
#include "mesh/split_cells.h"

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
    std::vector<std::int64_t>
        nodeIds;     ///< the file's number of every point, where blocks share points; else empty
    CellList cells;  ///< 3D cells that take part; node indices and face streams are checked
    std::vector<std::int64_t>
        sourceCell;  ///< position of each of these cells in the block; empty when it is the same
    std::int64_t sourceCells = 0;   ///< cells of the block of any kind
    std::vector<Field> fields;      ///< point: a tuple for every point; cell: one for every source cell
    std::vector<ArrayInfo> arrays;  ///< all arrays there are, asked for or not
};

/// A mesh before splitting.
struct RawMesh {
    std::vector<RawBlock> blocks;
    ImportStatistics statistics;  ///< what the reader of the format counts: cells, skipped, blanked, higher
                                  ///< order, warnings
};

/// What joining makes of the points of a block.
struct JoinedPoints {
    std::vector<std::int32_t> newIndex;  ///< of every point before
    std::vector<std::int32_t> kept;      ///< old index of every point that stays, ascending
    std::int64_t apart = 0;              ///< points that stay only because their values differ
};

/// Of the points of a merged block that belong to different parts, those at exactly the same place with the
/// same values become one. Points of one part stay apart, as do different values: jumps of a field stay.
/// Where one value isn't finite the other is written in its place. Independent of threads.
/// @param firstPoint of every part, ascending.
JoinedPoints joinParts(RawBlock& block, const std::vector<std::size_t>& firstPoint,
                       const Execution& execution);

/// What a message calls the mesh: its file, and how many other parts it has.
std::string meshName(const std::string& path, const ReadOptions& options);

/// The name under which a cell field is known when a point field has the same one.
std::string cellFieldName(const std::string& name);

/// Whether the options ask for an array of this name and place.
bool isWanted(const ReadOptions& options, const std::string& name, FieldLocation location);

/// Merges the blocks, their points that have one number, and the parts; drops nodes that no cell uses, splits
/// the cells, carries the fields over and fills the statistics. Throws InputError.
MeshFile assembleMesh(const std::string& path, RawMesh raw, const ReadOptions& options,
                      const Execution& execution);

}  // namespace tessera
