#pragma once

#include <functional>
#include <span>

#include "brick/brick_store.h"
#include "brick/kept_points.h"
#include "brick/seams.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// Values of all channels at a lattice point outside the mesh.
using ExtensionValues = std::function<void(int level, const Vec3i& p, std::span<double> values)>;

/// Gives the store an extension: values at points outside the mesh, so that the reconstruction can be read at
/// every place of the mesh from the store alone. The first layer is every point outside the mesh that the
/// reconstruction in a cell which the mesh touches depends on, and every neighbour (of 26) of a covered point
/// in its level; each further layer is what lies around those. Points that another leaf owns get no layer of
/// this one. What was there before goes. Does nothing for 0 layers.
/// @param reconstruction of this tree and store. @param kept no other point gets a value.
/// Throws InputError for fewer than 0 layers or more than a brick has cells.
void extendOutside(const TetMesh& mesh, const BrickTree& tree, BrickStore& store,
                   const Reconstruction& reconstruction, const KeptPoints& kept, int layers,
                   const ExtensionValues& values, const Execution& execution);

}  // namespace tessera
