#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "base/vec.h"

namespace tessera {

enum class FieldLocation { point, cell };

/// A field of numbers on the nodes or the elements of a mesh.
struct Field {
    std::string name;
    FieldLocation location = FieldLocation::point;
    int components = 1;  ///< 1 to 9
    std::vector<double>
        values;  ///< interleaved: values[item * components + component], item = node or element

    double at(std::int64_t item, int component) const {
        return values[std::size_t(item * components + component)];
    }
};

/// A tetrahedral mesh. Elements may be of either orientation, flat, overlapping or non-conforming.
struct TetMesh {
    std::vector<Vec3d> points;  ///< nodes, world units
    std::vector<std::array<std::int32_t, 4>>
        tets;                   ///< node indices of every element, each in [0, points.size())
    std::vector<Field> fields;  ///< cell fields have one tuple for every element

    std::int64_t nodeCount() const { return std::int64_t(points.size()); }
    std::int64_t elementCount() const { return std::int64_t(tets.size()); }
    /// Box of the nodes that elements use, world units.
    Box3d boundsWorld() const;
    /// Index into `fields`, or -1.
    int findField(const std::string& name) const;
};

/// Throws InternalError when sizes or indices do not fit together.
void checkMesh(const TetMesh& mesh);

/// Smallest and largest finite value of one component; min > max when there is none.
struct ValueRange {
    double min = std::numeric_limits<double>::infinity();
    double max = -std::numeric_limits<double>::infinity();
    bool empty() const { return !(min <= max); }
    double width() const { return empty() ? 0.0 : max - min; }
};
ValueRange fieldRange(const Field& field, int component);
/// Of the values that are finite in float, as samples are.
ValueRange finiteFloatRange(const Field& field, int component);

}  // namespace tessera
