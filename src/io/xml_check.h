#pragma once

#include <cstdint>
#include <string>

namespace tessera {

/// What the head of a VTK XML file declares.
struct XmlFileInfo {
    std::string type;         ///< e.g. "UnstructuredGrid"
    std::int64_t points = 0;  ///< summed over its pieces
    std::int64_t cells = 0;
};

/// Checks what VTK's own reader does not: that the file is a VTK XML file, whole to its end tag, and that it
/// declares no more than its size can hold. Throws InputError with the byte.
XmlFileInfo checkXmlFile(const std::string& path);

/// The same for a legacy VTK file: its head and the sizes it declares.
void checkLegacyFile(const std::string& path);

}  // namespace tessera
