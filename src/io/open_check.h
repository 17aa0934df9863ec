#pragma once

#include <string>

namespace tessera {

/// Opens and closes a file with the library beneath VTK's reader: that reader prints, or even ends the
/// process, when it can't. Throws InputError.
void checkExodusFile(const std::string& path);
void checkCgnsFile(const std::string& path);

}  // namespace tessera
