#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tessera/vec.h"

namespace tessera {

/// Where a field's values are: at the nodes, or one for each element.
enum class FieldLocation { point, cell };

/// A field of numbers on the nodes or the elements of a mesh.
struct Field {
    std::string name;
    FieldLocation location = FieldLocation::point;
    /// 1 to 9.
    int components = 1;
    /// Interleaved: values[item * components + component], where item is a node or an element.
    std::vector<double> values;

    double at(std::int64_t item, int component) const {
        return values[std::size_t(item * components + component)];
    }
};

/// A tetrahedral mesh. Elements may be of either orientation, flat, overlapping or non-conforming.
struct TetMesh {
    /// Nodes, world units.
    std::vector<Vec3d> points;
    /// Node indices of every element, each in [0, points.size()).
    std::vector<std::array<std::int32_t, 4>> tets;
    std::vector<Field> fields;

    std::int64_t nodeCount() const { return std::int64_t(points.size()); }
    std::int64_t elementCount() const { return std::int64_t(tets.size()); }
    /// Box of the nodes that elements use, world units; empty without elements.
    Box3d boundsWorld() const;
    /// Index into `fields` of the first field of that name, or -1.
    int findField(const std::string& name) const;
};

/// The indices of all fields, in order.
std::vector<int> everyField(const TetMesh& mesh);

/// Throws InputError, naming the element or field, when sizes or indices do not fit together.
void checkMesh(const TetMesh& mesh);

}  // namespace tessera
