#pragma once

#include <string>

#include "mesh_files/xml_check.h"

namespace tessera {

/// checkXmlFile for a legacy VTK file: its head and the sizes it declares.
DeclaredSize checkLegacyFile(const std::string& path);

}  // namespace tessera
