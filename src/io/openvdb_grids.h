#pragma once

#include <openvdb/openvdb.h>

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
