#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace tessera {

/// What the head of a VTK file declares.
struct DeclaredSize {
    std::string type;         ///< of VTK XML files, e.g. "UnstructuredGrid"
    std::int64_t points = 0;  ///< summed over the file's pieces; the files that it names left out
    std::int64_t cells = 0;
    std::int64_t fileBytes = 0;   ///< with all files that it names, each once
    std::int64_t cellsOfAll = 0;  ///< the same, of unstructured grids
    std::int64_t gridPoints = 0;  ///< the same, points of structured grids that have values
};

/// Checks what VTK's own reader does not: that the file is a VTK XML file, whole to its end tag, and that it
/// and the files that it names declare no more than their sizes can hold: points, cells, extents, components
/// and the sizes in front of packed arrays. Takes time in proportion to the files' sizes. Throws InputError
/// with the byte.
/// @param folder that named files have to lie in; none where it may be any.
DeclaredSize checkXmlFile(const std::string& path, const std::optional<std::string>& folder);

}  // namespace tessera
