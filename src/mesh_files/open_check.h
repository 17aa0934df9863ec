#pragma once

#include <string>
#include <vector>

namespace tessera {

/// Throws InputError for a file that reads others: by a link of HDF5 or CGNS to another file, or by external
/// or virtual storage of HDF5.
void refuseLinks(const std::string& path);

/// Opens and closes a file with the library beneath VTK's reader: that reader prints, or even ends the
/// process, when it can't. Checks the elements' nodes, which VTK's reader takes as they are. Throws
/// InputError.
void checkExodusFile(const std::string& path);

/// The fields of all zones of a file, a component of a vector each; VTK's reader lists those of the first.
struct CgnsFields {
    std::vector<std::string> atPoints, atCells;
    std::vector<std::string> warnings;  ///< a sentence for every zone of which VTK's reader leaves fields out
};
/// Opens and closes as checkExodusFile does.
CgnsFields checkCgnsFile(const std::string& path);

}  // namespace tessera
