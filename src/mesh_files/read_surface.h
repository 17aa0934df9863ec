#pragma once

#include <string>
#include <vector>

#include "mesh_files/read_mesh.h"
#include "surface/surface.h"

namespace tessera {

/// A surface, or scattered points, as a file holds it.
struct SurfaceFile {
    Surface surface;
    std::string format;             ///< e.g. "STL"
    std::vector<Vec3d> holesWorld;  ///< places in holes
    std::vector<RegionSeed> regions;
    std::vector<std::string> warnings;  ///< one sentence each
    /// Of every triangle the polygon of the file that it is part of, counted from 0.
    std::vector<std::int64_t> polygons;
    bool isOriented = true;  ///< triangles have an outside; TetGen's facets have none
};

/// Whether a file is one that tetrahedra have to be made of first, by its name: .stl, .ply, .obj, .off,
/// .poly, .csv, .vtp, or .node without its .ele.
bool isSurfaceName(const std::string& path);

/// Reads triangles, polygons of any number of corners (split into triangles) and points with their fields,
/// of the formats above and of VTK files with 2D cells or without cells. Values of triangles become those of
/// their points, as means. Points of an .stl file that lie at one place are one. Throws InputError, naming
/// the file and the place, when it is missing, empty, damaged or of another format, or a coordinate isn't
/// finite.
SurfaceFile readSurface(const std::string& path, const ReadOptions& options, const Execution& execution);

}  // namespace tessera
