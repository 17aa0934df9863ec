#include "reference/oracle.h"

#include <cmath>

#include "base/check.h"

namespace tessera {

/// The element's nodes relative to some origin.
struct Oracle::Corners {
    std::array<ExactVec, 4> at;

    /// Six times the signed volumes of the four tetrahedra that the origin spans with the faces; entry i
    /// leaves out node i.
    std::array<mpz_class, 4> volumes() const {
        const auto& [a, b, c, d] = at;
        const ExactVec cd = cross(c, d), ab = cross(a, b);
        return {dot(b, cd), -dot(a, cd), dot(d, ab), -dot(c, ab)};
    }
    /// Normals of the faces opposite to each node, all pointing inward for a positive element (outward for a
    /// negative one); length twice the area.
    std::array<ExactVec, 4> normals() const {
        const auto& [a, b, c, d] = at;
        const ExactVec ab = b - a, ac = c - a, ad = d - a, bc = c - b, bd = d - b;
        return {cross(bd, bc), cross(ac, ad), cross(ad, ab), cross(ab, ac)};
    }
};

Oracle::Oracle(const TetMesh& mesh, const Lattice& lattice)
    : mesh_(&mesh), lattice_(lattice), frame_(mesh, lattice) {}

Oracle::Corners Oracle::cornersFrom(std::int64_t element, const ExactVec& origin) const {
    const auto& tet = mesh_->tets[std::size_t(element)];
    return {{frame_.nodeFrom(tet[0], origin), frame_.nodeFrom(tet[1], origin),
             frame_.nodeFrom(tet[2], origin), frame_.nodeFrom(tet[3], origin)}};
}

int Oracle::volumeSign(std::int64_t element) const {
    const auto corners = cornersFrom(element, frame_.node(mesh_->tets[std::size_t(element)][0]));
    return sgn(dot(corners.at[1], cross(corners.at[2], corners.at[3])));
}

namespace {

mpz_class sum(const std::array<mpz_class, 4>& v) {
    return v[0] + v[1] + v[2] + v[3];
}

mpq_class ratio(const mpz_class& num, const mpz_class& den) {
    mpq_class q(num, den);
    q.canonicalize();
    return q;
}

/// A place in an element as integer weights over their common denominator, with the square of its distance
/// from the origin over the same.
struct Place {
    mpz_class squared, denominator = 1;
    std::array<mpz_class, 4> weights;
};

/// Keeps the nearer of two.
void offer(Place&& place, Place& best) {
    if (place.squared * best.denominator < best.squared * place.denominator) best = std::move(place);
}

void offerEdge(const std::array<ExactVec, 4>& at, std::size_t i, std::size_t j, Place& best) {
    const ExactVec edge = at[j] - at[i];
    const mpz_class along = -dot(at[i], edge);
    if (along <= 0) return;
    const mpz_class length = dot(edge, edge);
    if (along >= length) return;
    Place place{dot(at[i], at[i]) * length - along * along, length, {}};
    place.weights[i] = length - along;
    place.weights[j] = along;
    offer(std::move(place), best);
}

void offerFace(const std::array<ExactVec, 4>& at, std::size_t i, std::size_t j, std::size_t k, Place& best) {
    const ExactVec normal = cross(at[j] - at[i], at[k] - at[i]);
    // Areas of the three triangles that the origin's projection spans with the edges, times the length of the
    // normal.
    Place place;
    place.weights[i] = dot(normal, cross(at[j], at[k]));
    place.weights[j] = dot(normal, cross(at[k], at[i]));
    place.weights[k] = dot(normal, cross(at[i], at[j]));
    if (place.weights[i] <= 0 || place.weights[j] <= 0 || place.weights[k] <= 0) return;
    const mpz_class height = dot(normal, at[i]);
    place.squared = height * height;
    place.denominator = dot(normal, normal);
    offer(std::move(place), best);
}

}  // namespace

bool Oracle::contains(std::int64_t element, const Vec3i& p) const {
    const auto volumes = cornersFrom(element, frame_.latticePoint(p)).volumes();
    const int sign = sgn(sum(volumes));
    TESSERA_CHECK(sign != 0, "a flat element contains nothing");
    for (const mpz_class& v : volumes)
        if (sgn(v) * sign < 0) return false;
    return true;
}

ExactWeights Oracle::barycentrics(std::int64_t element, const Vec3i& p) const {
    const auto volumes = cornersFrom(element, frame_.latticePoint(p)).volumes();
    const mpz_class whole = sum(volumes);
    TESSERA_CHECK(whole != 0, "a flat element has no barycentric coordinates");
    return {ratio(volumes[0], whole), ratio(volumes[1], whole), ratio(volumes[2], whole),
            ratio(volumes[3], whole)};
}

std::array<double, 4> Oracle::approximateBarycentrics(std::int64_t element, const Vec3i& p) const {
    const auto volumes = cornersFrom(element, frame_.latticePoint(p)).volumes();
    const mpz_class whole = sum(volumes);
    TESSERA_CHECK(whole != 0, "a flat element has no barycentric coordinates");
    std::array<double, 4> weights;
    for (std::size_t i = 0; i < 4; ++i) weights[i] = approximateRatio(volumes[i], whole);
    return weights;
}

ExactNearest Oracle::nearest(std::int64_t element, const Vec3i& p) const {
    if (contains(element, p)) return {barycentrics(element, p), 0};
    const auto at = cornersFrom(element, frame_.latticePoint(p)).at;
    Place best{dot(at[0], at[0]), 1, {1, 0, 0, 0}};
    for (std::size_t i = 0; i < 4; ++i) {
        Place node{dot(at[i], at[i]), 1, {}};
        node.weights[i] = 1;
        offer(std::move(node), best);
        for (std::size_t j = i + 1; j < 4; ++j) {
            offerEdge(at, i, j, best);
            for (std::size_t k = j + 1; k < 4; ++k) offerFace(at, i, j, k, best);
        }
    }
    ExactNearest result;
    for (std::size_t i = 0; i < 4; ++i) result.weights[i] = ratio(best.weights[i], best.denominator);
    result.squaredDistance = ratio(best.squared, best.denominator * frame_.unit() * frame_.unit());
    return result;
}

double Oracle::depthVoxels(std::int64_t element, const Vec3i& p) const {
    const Corners corners = cornersFrom(element, frame_.latticePoint(p));
    const auto volumes = corners.volumes();
    const auto normals = corners.normals();
    const int sign = sgn(sum(volumes));
    TESSERA_CHECK(sign != 0, "a flat element has no depth");
    double depth = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < 4; ++i) {
        const mpz_class square = dot(normals[i], normals[i]) * frame_.unit() * frame_.unit();
        const double distance = std::sqrt(approximateRatio(volumes[i] * volumes[i], square));
        depth = std::min(depth, sgn(volumes[i]) * sign < 0 ? -distance : distance);
    }
    return depth;
}

mpq_class Oracle::interpolate(const Field& field, int component, std::int64_t element,
                              const ExactWeights& weights) const {
    mpq_class value;
    const auto& tet = mesh_->tets[std::size_t(element)];
    for (std::size_t i = 0; i < 4; ++i)
        if (weights[i] != 0) value += weights[i] * mpq_class(field.at(tet[i], component));
    return value;
}

mpq_class Oracle::squaredGradient(const Field& field, int component, std::int64_t element) const {
    const auto& tet = mesh_->tets[std::size_t(element)];
    const Corners corners = cornersFrom(element, frame_.node(tet[0]));
    const auto normals = corners.normals();
    const mpz_class volume = dot(corners.at[1], cross(corners.at[2], corners.at[3]));
    TESSERA_CHECK(volume != 0, "a flat element has no gradient");
    mpq_class x, y, z;
    for (std::size_t i = 0; i < 4; ++i) {
        const mpq_class f(field.at(tet[i], component));
        x += f * normals[i].x, y += f * normals[i].y, z += f * normals[i].z;
    }
    const mpq_class perVoxel = ratio(frame_.unit(), volume);
    return (x * x + y * y + z * z) * perVoxel * perVoxel;
}

}  // namespace tessera
