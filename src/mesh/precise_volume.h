#pragma once

#include "mesh/element_class.h"

namespace tessera {

/// |volume| of an element, world units cubed, within 1e-9 relatively for aspect ratios down to 1e-12: in
/// double where that is enough, else in 113 bits.
double preciseVolume(const Corners& corners);

/// Sum over all elements, compensated; the same for any number of threads.
double totalVolume(const TetMesh& mesh, const Execution& execution);

}  // namespace tessera
