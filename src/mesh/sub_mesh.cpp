#include "mesh/sub_mesh.h"

#include <algorithm>

#include "base/error.h"

namespace tessera {

namespace {

Field extractField(const Field& field, std::span<const std::int32_t> items) {
    Field part{field.name, field.location, field.components, {}};
    part.values.reserve(items.size() * std::size_t(field.components));
    for (const std::int32_t item : items)
        for (int c = 0; c < field.components; ++c) part.values.push_back(field.at(item, c));
    return part;
}

}  // namespace

TetMesh extractElements(const TetMesh& mesh, std::span<const std::int32_t> elements,
                        std::span<const int> fields) {
    std::vector<std::int32_t> nodes;
    nodes.reserve(4 * elements.size());
    std::int32_t last = -1;
    for (const std::int32_t e : elements) {
        TESSERA_CHECK(e > last && e < mesh.elementCount(), "elements of a part ascend and are in the mesh");
        last = e;
        nodes.insert(nodes.end(), mesh.tets[std::size_t(e)].begin(), mesh.tets[std::size_t(e)].end());
    }
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());

    TetMesh part;
    part.points.reserve(nodes.size());
    for (const std::int32_t node : nodes) part.points.push_back(mesh.points[std::size_t(node)]);
    part.tets.reserve(elements.size());
    for (const std::int32_t e : elements) {
        auto& tet = part.tets.emplace_back();
        for (std::size_t i = 0; i < 4; ++i)
            tet[i] = std::int32_t(std::lower_bound(nodes.begin(), nodes.end(), mesh.tets[std::size_t(e)][i]) -
                                  nodes.begin());
    }
    for (const int f : fields) {
        const Field& field = mesh.fields[std::size_t(f)];
        part.fields.push_back(extractField(field, field.location == FieldLocation::cell ? elements : nodes));
    }
    return part;
}

}  // namespace tessera
