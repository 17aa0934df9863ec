#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "tessera/mesh.h"

namespace tessera {

/// A function of a place in world units.
using PlaceFunction = std::function<double(const Vec3d&)>;

/// sin(9 x) cos(7 y) + z^2.
double wavyField(const Vec3d& p);

// Each appends one field to the mesh and returns its index in mesh.fields.

/// A point field with the functions' values at the nodes, one component a function.
int addPointField(TetMesh& mesh, const std::string& name, const std::vector<PlaceFunction>& components);
/// A cell field with the functions' values at the centroids.
int addCellField(TetMesh& mesh, const std::string& name, const std::vector<PlaceFunction>& components);
/// A point or cell field of numbers offset + scale x [-1, 1), independent from item to item.
int addRandomField(TetMesh& mesh, const std::string& name, FieldLocation location, int components,
                   double offset, double scale, std::uint64_t seed);
/// A cell field that tells which element owns a point: its index, exact in float up to 2^24.
int addElementIdField(TetMesh& mesh, const std::string& name);
/// A copy of the field with NaN, +infinity and -infinity in turn at every `stride`-th item, first component.
int addHoledCopy(TetMesh& mesh, int field, const std::string& name, std::int64_t stride);

}  // namespace tessera
