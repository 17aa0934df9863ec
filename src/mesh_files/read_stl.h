#pragma once

#include "mesh_files/number_lines.h"
#include "mesh_files/raw_surface.h"

namespace tessera {

/// Text or binary. Every triangle has corners of its own.
/// Throws InputError with the file and the place.
RawSurface readStl(const NamedText& text);

}  // namespace tessera
