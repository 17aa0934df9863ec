#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "mesh_files/number_lines.h"
#include "mesh_files/raw_mesh.h"

namespace tessera {

/// Reads TetGen's pair name.node and name.ele, given either. Indices count from 0 or 1 as the first node's
/// does. Point attributes become point fields attribute_1, attribute_2, ...; the region attribute of elements
/// becomes the cell field "region". Boundary markers are left out. Throws InputError with file and line.
RawMesh readTetgen(const std::string& path, const ReadOptions& options);

/// The nodes of a .node or .poly file, from its first line on: appends points and fields, and returns the
/// index of the first; none where the file declares no nodes.
std::optional<std::int64_t> readTetgenNodes(NumberLines& lines, RawBlock& block);

/// readTetgen without files: the contents of both.
RawMesh parseTetgen(const NamedText& nodes, const NamedText& elements, const ReadOptions& options);

}  // namespace tessera
