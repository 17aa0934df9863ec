#include "reference/fields.h"

#include <cmath>
#include <limits>

#include "reference/random.h"

namespace tessera {

namespace {

int append(TetMesh& mesh, Field field) {
    mesh.fields.push_back(std::move(field));
    return int(mesh.fields.size()) - 1;
}

}  // namespace

double wavyField(const Vec3d& p) {
    return std::sin(9 * p.x) * std::cos(7 * p.y) + p.z * p.z;
}

int addPointField(TetMesh& mesh, const std::string& name, const std::vector<PlaceFunction>& components) {
    Field field{name, FieldLocation::point, int(components.size()), {}};
    for (const Vec3d& p : mesh.points)
        for (const PlaceFunction& f : components) field.values.push_back(f(p));
    return append(mesh, std::move(field));
}

int addCellField(TetMesh& mesh, const std::string& name, const std::vector<PlaceFunction>& components) {
    Field field{name, FieldLocation::cell, int(components.size()), {}};
    for (const auto& tet : mesh.tets) {
        Vec3d centroid{0};
        for (const std::int32_t n : tet) centroid += 0.25 * mesh.points[std::size_t(n)];
        for (const PlaceFunction& f : components) field.values.push_back(f(centroid));
    }
    return append(mesh, std::move(field));
}

int addRandomField(TetMesh& mesh, const std::string& name, FieldLocation location, int components,
                   double offset, double scale, std::uint64_t seed) {
    Field field{name, location, components, {}};
    const std::int64_t items = location == FieldLocation::point ? mesh.nodeCount() : mesh.elementCount();
    Random random(seed);
    for (std::int64_t i = 0; i < items * components; ++i)
        field.values.push_back(offset + scale * random.centred());
    return append(mesh, std::move(field));
}

int addElementIdField(TetMesh& mesh, const std::string& name) {
    Field field{name, FieldLocation::cell, 1, {}};
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) field.values.push_back(double(e));
    return append(mesh, std::move(field));
}

int addHoledCopy(TetMesh& mesh, int field, const std::string& name, std::int64_t stride) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    constexpr double kHoles[] = {std::numeric_limits<double>::quiet_NaN(), kInfinity, -kInfinity};
    Field copy = mesh.fields[std::size_t(field)];
    copy.name = name;
    const auto step = std::size_t(stride) * std::size_t(copy.components);
    for (std::size_t i = 0, n = 0; i < copy.values.size(); i += step, ++n) copy.values[i] = kHoles[n % 3];
    return append(mesh, std::move(copy));
}

}  // namespace tessera
