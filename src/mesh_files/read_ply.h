#pragma once

#include "mesh_files/number_lines.h"
#include "mesh_files/raw_surface.h"

namespace tessera {

/// Text or binary. Numbers of the vertices beside x, y and z become fields, and so do those of the faces:
/// red, green and blue together "color", nx, ny and nz "normal".
/// Throws InputError with the file and the place.
RawSurface readPly(const NamedText& text);

}  // namespace tessera
