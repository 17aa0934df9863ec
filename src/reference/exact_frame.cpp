#include "reference/exact_frame.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

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

/// Turns doubles into integers by one common power of two.
class Scale {
  public:
    void include(const Vec3d& v) {
        for (int a = 0; a < 3; ++a) {
            const Split s = split(v[a]);
            if (s.mantissa != 0) lowest_ = std::min(lowest_, s.exponent);
        }
    }
    ExactVec operator()(const Vec3d& v) const { return {scaled(v.x), scaled(v.y), scaled(v.z)}; }

  private:
    mpz_class scaled(double value) const {
        const Split s = split(value);
        mpz_class result = long(s.mantissa);
        if (s.mantissa != 0) result <<= mp_bitcnt_t(s.exponent - lowest_);
        return result;
    }
    int lowest_ = 4096;
};

}  // namespace

ExactFrame::ExactFrame(const TetMesh& mesh, const Lattice& lattice) {
    std::vector<std::uint8_t> used(mesh.points.size(), 0);
    for (const auto& tet : mesh.tets)
        for (const std::int32_t n : tet) used[std::size_t(n)] = 1;

    Scale scale;
    for (const Vec3d& v : {lattice.originWorld, lattice.uWorld, lattice.vWorld, lattice.wWorld})
        scale.include(v);
    for (std::size_t n = 0; n < used.size(); ++n)
        if (used[n]) scale.include(mesh.points[n]);

    const ExactVec origin = scale(lattice.originWorld);
    const ExactVec u = scale(lattice.uWorld), v = scale(lattice.vWorld), w = scale(lattice.wWorld);
    ExactVec rowX = cross(v, w), rowY = cross(w, u), rowZ = cross(u, v);
    unit_ = dot(u, rowX);
    TESSERA_CHECK(unit_ != 0, "the lattice's frame vectors are linearly dependent");
    const bool isCubic = lattice.isAxisParallel() && u.x == v.y && u.x == w.z;
    if (isCubic) {  // the same space with numbers a third as long
        unit_ = u.x;
        rowX = {1, 0, 0}, rowY = {0, 1, 0}, rowZ = {0, 0, 1};
    }
    if (unit_ < 0) {
        unit_ = -unit_;
        for (ExactVec* row : {&rowX, &rowY, &rowZ}) *row = {-row->x, -row->y, -row->z};
    }

    nodes_.resize(used.size());
    indexNodes_.resize(used.size());
    for (std::size_t n = 0; n < used.size(); ++n) {
        if (!used[n]) continue;
        const ExactVec p = scale(mesh.points[n]) - origin;
        nodes_[n] = isCubic ? p : ExactVec{dot(rowX, p), dot(rowY, p), dot(rowZ, p)};
        indexNodes_[n] = {approximateRatio(nodes_[n].x, unit_), approximateRatio(nodes_[n].y, unit_),
                          approximateRatio(nodes_[n].z, unit_)};
    }
}

ExactVec ExactFrame::latticePoint(const Vec3i& p) const {
    return {unit_ * p.x, unit_ * p.y, unit_ * p.z};
}

}  // namespace tessera
