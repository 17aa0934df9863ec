#pragma once

#include "reader/serve_reader.h"

namespace tessera {

/// The task "tetrahedralize" of tetrahedralizeIsolated: reads a surface or points, checks them, has TetGen
/// make tetrahedra, and carries the fields to all nodes.
ReaderTask tetrahedralizeTask();

}  // namespace tessera
