#pragma once

#include <string>
#include <string_view>

#include "mesh_files/raw_mesh.h"

namespace tessera {

/// Reads TetGen's pair name.node and name.ele, given either. Indices count from 0 or 1 as the first node's
/// does. Point attributes become point fields attribute_1, attribute_2, ...; the region attribute of elements
/// becomes the cell field "region". Boundary markers are left out. Throws InputError with file and line.
RawMesh readTetgen(const std::string& path, const ReadOptions& options);

/// Text that stands in memory, and what messages call it.
struct NamedText {
    std::string name;
    std::string_view bytes;
};

/// readTetgen without files: the contents of both.
RawMesh parseTetgen(const NamedText& nodes, const NamedText& elements, const ReadOptions& options);

}  // namespace tessera
