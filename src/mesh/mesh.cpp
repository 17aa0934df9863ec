#include "tessera/mesh.h"

#include <numeric>

#include "tessera/error.h"

namespace tessera {

Box3d TetMesh::boundsWorld() const {
    Box3d box;
    for (const auto& tet : tets)
        for (const std::int32_t node : tet) box.include(points[std::size_t(node)]);
    return box;
}

int TetMesh::findField(const std::string& name) const {
    for (std::size_t f = 0; f < fields.size(); ++f)
        if (fields[f].name == name) return int(f);
    return -1;
}

std::vector<int> everyField(const TetMesh& mesh) {
    std::vector<int> all(mesh.fields.size());
    std::iota(all.begin(), all.end(), 0);
    return all;
}

void checkMesh(const TetMesh& mesh) {
    const std::int64_t nodes = mesh.nodeCount();
    for (std::int64_t element = 0; element < mesh.elementCount(); ++element)
        for (const std::int32_t node : mesh.tets[std::size_t(element)])
            if (node < 0 || node >= nodes)
                throw InputError("element " + std::to_string(element) + " has node " + std::to_string(node) +
                                 ", and the mesh has " + std::to_string(nodes) + " nodes");
    for (const Field& field : mesh.fields) {
        if (field.components < 1 || field.components > 9)
            throw InputError("field " + field.name + " has " + std::to_string(field.components) +
                             " components, not 1 to 9");
        const bool isOnNodes = field.location == FieldLocation::point;
        const std::int64_t expected = (isOnNodes ? nodes : mesh.elementCount()) * field.components;
        if (std::int64_t(field.values.size()) != expected)
            throw InputError("field " + field.name + " has " + std::to_string(field.values.size()) +
                             " values, and the mesh's " + (isOnNodes ? "nodes" : "elements") + " need " +
                             std::to_string(expected));
    }
}

}  // namespace tessera
