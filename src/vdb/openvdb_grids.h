#pragma once

#include <openvdb/openvdb.h>

#include "refine/brick_result.h"
#include "vdb/vdb_file.h"

// OpenVDB's library holds the members of these, as it registers them to read files: compiling them again
// costs a minute a source. Without optimisation small ones would be called that the library has only inlined.
#ifdef __OPTIMIZE__
extern template class openvdb::Grid<openvdb::FloatTree>;
extern template class openvdb::Grid<openvdb::Vec3STree>;
extern template class openvdb::Grid<openvdb::BoolTree>;
extern template class openvdb::tree::Tree<openvdb::FloatTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::Vec3STree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::BoolTree::RootNodeType>;
#endif

namespace tessera {

/// Where a file holds its UUID, as text: after magic, format, library's two version numbers and a flag.
constexpr std::size_t kUuidOffset = 21, kUuidBytes = 36;

/// A place's or a vector's components in the file's axes, from those of the mesh.
template <class Vector>
Vector turned(const Vector& v, UpAxis upAxis) {
    if (upAxis == UpAxis::y) return Vector(v[0], v[2], -v[1]);
    if (upAxis == UpAxis::z) return Vector(v[0], -v[2], v[1]);
    return v;
}
/// The way back.
template <class Vector>
Vector turnedBack(const Vector& v, UpAxis upAxis) {
    if (upAxis == UpAxis::y) return Vector(v[0], -v[2], v[1]);
    if (upAxis == UpAxis::z) return Vector(v[0], v[2], -v[1]);
    return v;
}

/// The grids that writeVdb writes, as OpenVDB's own grids in memory, for writers of formats that are made
/// from those. Throws as writeVdb does, and frees the store's tiles on the way.
/// @param written gets the unit and the notes.
openvdb::GridPtrVec buildVdbGrids(const std::vector<OutputField>& fields, BrickResult& result,
                                  const VdbWriteOptions& options, VdbWriteResult& written,
                                  const Execution& execution);

}  // namespace tessera
