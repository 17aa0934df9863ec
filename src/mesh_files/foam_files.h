#pragma once

#include <optional>
#include <string>

namespace tessera {

/// Looks at what VTK's reader opens of an OpenFOAM case: the dictionary, the meshes, and the folders of the
/// times. Throws InputError for a pipe or a device, and with `folder` for a link or an #include that leads
/// out of it. Of the times' files only the beginnings are searched for #include.
/// @param path the .foam file in the case's folder.
void checkFoamFiles(const std::string& path, const std::optional<std::string>& folder);

/// Searches all that is read of one time.
void checkFoamTime(const std::string& path, const std::string& folder, double time);

}  // namespace tessera
