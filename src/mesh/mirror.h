#pragma once

#include "tessera/mesh.h"

namespace tessera {

/// The mesh together with its mirror image at the plane where coordinate `axis` (0 to 2) is `planeWorld`:
/// twice the elements, first those there were, then their images in the same order and of the same
/// orientation. Nodes exactly on the plane are shared, so a mesh that lies on one side of it stays
/// conforming. Fields are copied as they are: components of vectors are not turned round.
TetMesh withMirrorImage(const TetMesh& mesh, int axis, double planeWorld);

}  // namespace tessera
