#include "reference/oracle.h"

#include <cmath>

#include "base/error.h"

namespace tessera {

/// The element's nodes relative to some origin.
struct Oracle::Corners {
    std::array<ExactVec, 4> at;

    /// Six times the signed volumes of the four tetrahedra that the origin spans with the faces; entry i leaves out node i.
    std::array<mpz_class, 4> volumes() const {
        const auto& [a, b, c, d] = at;
        const ExactVec cd = cross(c, d), ab = cross(a, b);
        return {dot(b, cd), -dot(a, cd), dot(d, ab), -dot(c, ab)};
    }
    /// Normals of the faces opposite to each node, all pointing inward for a positive element (outward for a negative one); length twice the area.
    std::array<ExactVec, 4> normals() const {
        const auto& [a, b, c, d] = at;
        const ExactVec ab = b - a, ac = c - a, ad = d - a, bc = c - b, bd = d - b;
        return {cross(bd, bc), cross(ac, ad), cross(ad, ab), cross(ab, ac)};
    }
};

Oracle::Oracle(const TetMesh& mesh, const Lattice& lattice) : mesh_(&mesh), lattice_(lattice), frame_(mesh, lattice) {}

Oracle::Corners Oracle::cornersFrom(std::int64_t element, const ExactVec& origin) const {
    const auto& tet = mesh_->tets[std::size_t(element)];
    return {{frame_.node(tet[0]) - origin, frame_.node(tet[1]) - origin, frame_.node(tet[2]) - origin,
             frame_.node(tet[3]) - origin}};
}

int Oracle::volumeSign(std::int64_t element) const {
    const auto corners = cornersFrom(element, frame_.node(mesh_->tets[std::size_t(element)][0]));
    return sgn(dot(corners.at[1], cross(corners.at[2], corners.at[3])));
}

namespace {

mpz_class sum(const std::array<mpz_class, 4>& v) { return v[0] + v[1] + v[2] + v[3]; }

mpq_class ratio(const mpz_class& num, const mpz_class& den) {
    mpq_class q(num, den);
    q.canonicalize();
    return q;
}

/// Keeps the nearest of the places offered; the origin is the place it measures from.
class Nearest {
  public:
    void offer(const mpq_class& squaredDistance, const ExactWeights& weights) {
        if (found_ && squaredDistance >= best_.squaredDistance) return;
        best_ = {weights, squaredDistance};
        found_ = true;
    }
    const ExactNearest& best() const { return best_; }

  private:
    ExactNearest best_;
    bool found_ = false;
};

void offerEdge(const std::array<ExactVec, 4>& at, std::size_t i, std::size_t j, Nearest& nearest) {
    const ExactVec edge = at[j] - at[i];
    const mpz_class along = -dot(at[i], edge), length = dot(edge, edge);
    if (along <= 0 || along >= length) return;
    const mpq_class t = ratio(along, length);
    ExactWeights weights;
    weights[i] = 1 - t;
    weights[j] = t;
    nearest.offer(mpq_class(dot(at[i], at[i])) - t * along, weights);
}

void offerFace(const std::array<ExactVec, 4>& at, std::size_t i, std::size_t j, std::size_t k, Nearest& nearest) {
    const ExactVec normal = cross(at[j] - at[i], at[k] - at[i]);
    // Areas of the three triangles that the origin's projection spans with the edges, times the length of the normal.
    const mpz_class wi = dot(normal, cross(at[j], at[k])), wj = dot(normal, cross(at[k], at[i])),
                    wk = dot(normal, cross(at[i], at[j]));
    if (wi <= 0 || wj <= 0 || wk <= 0) return;
    const mpz_class square = dot(normal, normal), height = dot(normal, at[i]);
    ExactWeights weights;
    weights[i] = ratio(wi, square);
    weights[j] = ratio(wj, square);
    weights[k] = ratio(wk, square);
    nearest.offer(ratio(height * height, square), weights);
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
    return {ratio(volumes[0], whole), ratio(volumes[1], whole), ratio(volumes[2], whole), ratio(volumes[3], whole)};
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
    const Corners corners = cornersFrom(element, frame_.latticePoint(p));
    Nearest nearest;
    for (std::size_t i = 0; i < 4; ++i) {
        ExactWeights weights;
        weights[i] = 1;
        nearest.offer(mpq_class(dot(corners.at[i], corners.at[i])), weights);
        for (std::size_t j = i + 1; j < 4; ++j) {
            offerEdge(corners.at, i, j, nearest);
            for (std::size_t k = j + 1; k < 4; ++k) offerFace(corners.at, i, j, k, nearest);
        }
    }
    ExactNearest result = nearest.best();
    result.squaredDistance /= frame_.unit() * frame_.unit();
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

mpq_class Oracle::interpolate(const Field& field, int component, std::int64_t element, const ExactWeights& weights) const {
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
