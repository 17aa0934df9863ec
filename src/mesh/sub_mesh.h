#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tessera/mesh.h"

namespace tessera {

/// Some elements of a mesh as a mesh of their own, with the nodes that they use and the chosen fields.
/// Elements and nodes keep their order, so a rule that goes by their numbers decides as in the whole mesh.
/// Costs time in proportion to the part, not to the mesh.
/// @param elements ascending, each once. @param fields indices into mesh.fields, in the order of the
/// result's.
TetMesh extractElements(const TetMesh& mesh, std::span<const std::int32_t> elements,
                        std::span<const int> fields);

}  // namespace tessera
