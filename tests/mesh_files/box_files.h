#pragma once

// One small mesh in the formats of simulation programs, as their own libraries write it or by hand: a box of
// 2 x 1 x 1 of a hexahedron, and two wedges beside it that share the face x = 1 with it.

#include <vtk_cgns.h>
#include VTK_CGNS(cgnslib.h)

#include <array>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "tessera/vec.h"

namespace tessera::test {

constexpr int kNodes = 12;
constexpr std::array<int, 8> kHexahedron{0, 1, 4, 3, 6, 7, 10, 9};
constexpr std::array<std::array<int, 6>, 2> kWedges{{{1, 2, 4, 7, 8, 10}, {2, 5, 4, 8, 11, 10}}};
constexpr std::array<double, 3> kCellValues{10, 20, 40};

Vec3d node(int i);
double scalarAt(const Vec3d& p, int step);
Vec3d vectorAt(const Vec3d& p);
std::vector<double> nodeValues(const std::function<double(const Vec3d&)>& value);

/// Two blocks and two steps. @param mode EX_CLOBBER, and what the library adds to it: EX_NETCDF4.
void writeExodus(const std::string& path, int mode);

/// Throws the CGNS library's message unless `status` is 0.
void checkCgns(int status);

/// A file that is open, with a base.
struct CgnsFile {
    /// @param kind CG_FILE_ADF or CG_FILE_HDF5
    CgnsFile(const std::string& where, int kind);
    std::string path;
    int file = 0, base = 0;
};
void writeCgnsNodes(int file, int base, int zone);
void writeCgnsCells(int file, int base, int zone, const std::vector<double>& values);
/// The box as nodes and lists of cells, as a grid of two cells, or its first cell as a polyhedron.
void writeCgnsUnstructured(const std::string& path, int kind);
void writeCgnsStructured(const std::string& path, int kind);
void writeCgnsPolyhedron(const std::string& path, int kind);

/// EnSight Gold, or the older EnSight 6.
enum class EnSightVersion { gold, six };
enum class Encoding { text, binary };

/// Writes box.case and its files, two steps of the variables. Returns the name of the case. Binary files of
/// EnSight 6 have no temperature: VTK 9.1 can't read scalars at their nodes.
std::string writeEnSight(const std::string& folder, EnSightVersion version = EnSightVersion::gold,
                         Encoding encoding = Encoding::text);

/// @param region empty, or the region's name and a slash.
void writeFoamMesh(const std::string& folder, const std::string& region, Encoding encoding = Encoding::text);
/// Two steps, which have two cell fields and a point field each.
void writeFoamFields(const std::string& folder, const std::string& region,
                     Encoding encoding = Encoding::text);

}  // namespace tessera::test
