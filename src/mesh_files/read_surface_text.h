#pragma once

#include <functional>
#include <string>

#include "mesh_files/number_lines.h"
#include "mesh_files/raw_surface.h"

namespace tessera {

// Each throws InputError with the file and the line. Indices are checked.

/// The plain kind of .off files, as text.
RawSurface readOff(const NamedText& text);
/// Points and faces; of other things there are none. Colours behind a point's place become the field "color".
RawSurface readObj(const NamedText& text);
/// A table of points, one a line, with commas, semicolons, tabs or blanks between. The first line may name
/// the columns: x, y and z in any case, or Points:0 to Points:2, are the place, else the first three. name:0,
/// name:1, ... are the components of one field. An empty word is no value (NaN).
RawSurface readCsv(const NamedText& text);
/// A .poly file of TetGen: facets of several polygons, which may be holes in one another, holes and regions.
/// @param nodesPath the .node file beside it, @param readNodes gives its bytes: asked for where this has
/// none.
RawSurface readPoly(const NamedText& text, const std::string& nodesPath,
                    const std::function<std::string()>& readNodes);
/// The points of a .node file alone.
RawSurface readNodePoints(const NamedText& text);

}  // namespace tessera
