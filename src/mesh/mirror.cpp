#include "mesh/mirror.h"

#include <limits>
#include <utility>

#include "base/check.h"
#include "tessera/error.h"

namespace tessera {

namespace {

void appendTuple(Field& field, std::int64_t item) {
    for (int c = 0; c < field.components; ++c) field.values.push_back(field.at(item, c));
}

}  // namespace

TetMesh withMirrorImage(const TetMesh& mesh, int axis, double planeWorld) {
    TESSERA_CHECK(axis >= 0 && axis < 3, "an axis is 0, 1 or 2");
    if (mesh.nodeCount() > std::numeric_limits<std::int32_t>::max() / 2)
        throw InputError("the mesh has too many nodes to be mirrored");
    TetMesh both = mesh;
    std::vector<std::int32_t> imageOf(mesh.points.size());
    for (std::size_t n = 0; n < mesh.points.size(); ++n) {
        Vec3d image = mesh.points[n];
        if (image[axis] == planeWorld) {
            imageOf[n] = std::int32_t(n);
            continue;
        }
        image[axis] = planeWorld - (image[axis] - planeWorld);
        imageOf[n] = std::int32_t(both.points.size());
        both.points.push_back(image);
        for (Field& field : both.fields)
            if (field.location == FieldLocation::point) appendTuple(field, std::int64_t(n));
    }
    both.tets.reserve(2 * mesh.tets.size());
    for (const auto& tet : mesh.tets) {
        std::array<std::int32_t, 4> image;
        for (std::size_t i = 0; i < 4; ++i) image[i] = imageOf[std::size_t(tet[i])];
        // A reflection turns an element inside out.
        std::swap(image[2], image[3]);
        both.tets.push_back(image);
    }
    for (Field& field : both.fields)
        if (field.location == FieldLocation::cell)
            for (std::int64_t e = 0; e < mesh.elementCount(); ++e) appendTuple(field, e);
    return both;
}

}  // namespace tessera
