#include "mesh/tet_mesh.h"

#include <cmath>

#include "base/error.h"

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

void checkMesh(const TetMesh& mesh) {
    const std::int64_t nodes = mesh.nodeCount();
    for (const auto& tet : mesh.tets)
        for (const std::int32_t node : tet)
            TESSERA_CHECK(node >= 0 && node < nodes, "an element's node index is out of range");
    for (const Field& field : mesh.fields) {
        TESSERA_CHECK(field.components >= 1 && field.components <= 9,
                      "a field has 1 to 9 components: " + field.name);
        const std::int64_t items = field.location == FieldLocation::point ? nodes : mesh.elementCount();
        TESSERA_CHECK(std::int64_t(field.values.size()) == items * field.components,
                      "a field's size does not fit the mesh: " + field.name);
    }
}

namespace {

template <class Takes>
ValueRange rangeOf(const Field& field, int component, const Takes& takes) {
    ValueRange range;
    for (std::size_t i = std::size_t(component); i < field.values.size();
         i += std::size_t(field.components)) {
        const double v = field.values[i];
        if (!takes(v)) continue;
        if (v < range.min) range.min = v;
        if (v > range.max) range.max = v;
    }
    return range;
}

}  // namespace

ValueRange fieldRange(const Field& field, int component) {
    return rangeOf(field, component, [](double v) { return std::isfinite(v); });
}

ValueRange finiteFloatRange(const Field& field, int component) {
    return rangeOf(field, component, [](double v) { return std::isfinite(float(v)); });
}

}  // namespace tessera
