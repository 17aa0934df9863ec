#include "reference/exact_frame.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <optional>

#include "base/check.h"

namespace tessera {

ExactVec operator-(const ExactVec& a, const ExactVec& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}

ExactVec cross(const ExactVec& a, const ExactVec& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

mpz_class dot(const ExactVec& a, const ExactVec& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

double approximateRatio(const mpz_class& num, const mpz_class& den) {
    long numExponent = 0, denExponent = 0;
    const double n = mpz_get_d_2exp(&numExponent, num.get_mpz_t());
    const double d = mpz_get_d_2exp(&denExponent, den.get_mpz_t());
    return std::ldexp(n / d, int(std::clamp(numExponent - denExponent, -5000l, 5000l)));
}

namespace {

/// value = mantissa x 2^exponent with an odd mantissa (or zero).
struct Split {
    std::int64_t mantissa = 0;
    int exponent = 0;
};

Split split(double value) {
    TESSERA_CHECK(std::isfinite(value), "the oracle needs finite coordinates");
    if (value == 0) return {};
    int exponent = 0;
    const double fraction = std::frexp(value, &exponent);
    const auto mantissa = std::int64_t(std::ldexp(fraction, 53));
    const int zeros = std::countr_zero(std::uint64_t(mantissa));
    return {mantissa >> zeros, exponent - 53 + zeros};
}

/// The lowest exponent of any of their bits.
int lowestExponent(const Vec3d& v) {
    int lowest = 4096;
    for (int a = 0; a < 3; ++a) {
        const Split s = split(v[a]);
        if (s.mantissa != 0) lowest = std::min(lowest, s.exponent);
    }
    return lowest;
}

mpz_class scaledBy(double value, int lowestExponent) {
    const Split s = split(value);
    mpz_class result = long(s.mantissa);
    if (s.mantissa != 0) result <<= mp_bitcnt_t(s.exponent - lowestExponent);
    return result;
}

/// (place - origin) / spacing: two roundings of 2^-53 each; nothing where the quotient leaves the range in
/// which that holds.
std::optional<double> roundedIndex(double place, double origin, double spacing) {
    const double difference = place - origin, index = difference / spacing;
    if (difference != 0 && !(std::abs(index) > 1e-290 && std::isfinite(index))) return std::nullopt;
    return index;
}

/// Of larger meshes few nodes are asked for; to convert all would take longer than the answers.
constexpr std::size_t kMostStored = 200'000;

}  // namespace

ExactFrame::ExactFrame(const TetMesh& mesh, const Lattice& lattice) : mesh_(&mesh), lowestExponent_(4096) {
    std::vector<std::uint8_t> used(mesh.points.size(), 0);
    for (const auto& tet : mesh.tets)
        for (const std::int32_t n : tet) used[std::size_t(n)] = 1;

    for (const Vec3d& v : {lattice.originWorld, lattice.uWorld, lattice.vWorld, lattice.wWorld})
        lowestExponent_ = std::min(lowestExponent_, lowestExponent(v));
    for (std::size_t n = 0; n < used.size(); ++n)
        if (used[n]) lowestExponent_ = std::min(lowestExponent_, lowestExponent(mesh.points[n]));

    origin_ = scaled(lattice.originWorld);
    const ExactVec u = scaled(lattice.uWorld), v = scaled(lattice.vWorld), w = scaled(lattice.wWorld);
    rows_ = {cross(v, w), cross(w, u), cross(u, v)};
    unit_ = dot(u, rows_[0]);
    TESSERA_CHECK(unit_ != 0, "the lattice's frame vectors are linearly dependent");
    isCubic_ = lattice.isAxisParallel() && u.x == v.y && u.x == w.z;
    if (isCubic_) unit_ = u.x;
    if (unit_ < 0) {
        unit_ = -unit_;
        for (ExactVec& row : rows_) row = {-row.x, -row.y, -row.z};
    }

    const bool isStored = !isCubic_ || used.size() <= kMostStored;
    if (isStored) nodes_.resize(used.size());
    indexNodes_.resize(used.size());
    for (std::size_t n = 0; n < used.size(); ++n) {
        if (!used[n]) continue;
        if (isStored) nodes_[n] = exactNode(std::int32_t(n));
        for (int a = 0; a < 3; ++a) {
            std::optional<double> index;
            if (isCubic_) index = roundedIndex(mesh.points[n][a], lattice.originWorld[a], lattice.uWorld.x);
            if (!index) {
                const ExactVec exact = node(std::int32_t(n));
                index = approximateRatio(a == 0 ? exact.x : a == 1 ? exact.y : exact.z, unit_);
            }
            indexNodes_[n][a] = *index;
        }
    }
}

ExactVec ExactFrame::scaled(const Vec3d& v) const {
    return {scaledBy(v.x, lowestExponent_), scaledBy(v.y, lowestExponent_), scaledBy(v.z, lowestExponent_)};
}

ExactVec ExactFrame::exactNode(std::int32_t n) const {
    const ExactVec p = scaled(mesh_->points[std::size_t(n)]) - origin_;
    return isCubic_ ? p : ExactVec{dot(rows_[0], p), dot(rows_[1], p), dot(rows_[2], p)};
}

ExactVec ExactFrame::node(std::int32_t n) const {
    return nodes_.empty() ? exactNode(n) : nodes_[std::size_t(n)];
}

ExactVec ExactFrame::nodeFrom(std::int32_t n, const ExactVec& origin) const {
    return nodes_.empty() ? exactNode(n) - origin : nodes_[std::size_t(n)] - origin;
}

ExactVec ExactFrame::latticePoint(const Vec3i& p) const {
    return {unit_ * p.x, unit_ * p.y, unit_ * p.z};
}

}  // namespace tessera
