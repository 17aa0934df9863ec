// Elements too thin for double precision: the same walk in 113-bit arithmetic and, where even that is too
// coarse, in rationals.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "index_space/exact_scan.h"
#include "mesh/geometry.h"

namespace tessera {

namespace {

double toDouble(Quad x) {
    return double(x);
}
double toDouble(const mpq_class& x) {
    return x.get_d();
}

double floorToDouble(Quad x) {
    const double rounded = double(x);
    if (std::fabs(rounded) >= 0x1p52) return rounded;
    const double whole = std::floor(rounded);
    return Quad(whole) > x ? whole - 1 : whole;
}
double floorToDouble(const mpq_class& x) {
    mpz_class whole;
    mpz_fdiv_q(whole.get_mpz_t(), x.get_num_mpz_t(), x.get_den_mpz_t());
    return whole.get_d();
}
template <class Real>
double ceilToDouble(const Real& x) {
    return -floorToDouble(Real(-x));
}
template <class Real>
Real absolute(const Real& x) {
    return x < 0 ? Real(-x) : x;
}

// An element in index coordinates relative to its first voxel, and its barycentrics constant + gradient . (x,
// y, z).
template <class Real>
struct ExactElement {
    double base[3];
    Real node[4][3];
    Real low[3], high[3];
    Real gradient[4][3];
    Real constant[4];
    Real dilation;  // bound on the rounding of a barycentric coordinate
};

// Gives the determinant, six times the volume in voxels; gradients only when it isn't zero.
template <class Real>
Real setUpGradients(ExactElement<Real>& e) {
    Real edge[3][3], normal[3][3];
    for (int k = 0; k < 3; ++k)
        for (int a = 0; a < 3; ++a) edge[k][a] = e.node[k + 1][a] - e.node[0][a];
    for (int k = 0; k < 3; ++k) {
        const auto& p = edge[(k + 1) % 3];
        const auto& q = edge[(k + 2) % 3];
        for (int a = 0; a < 3; ++a)
            normal[k][a] = p[(a + 1) % 3] * q[(a + 2) % 3] - p[(a + 2) % 3] * q[(a + 1) % 3];
    }
    const Real det = edge[0][0] * normal[0][0] + edge[0][1] * normal[0][1] + edge[0][2] * normal[0][2];
    if (det == 0) return det;
    e.constant[0] = 1;
    for (int a = 0; a < 3; ++a) e.gradient[0][a] = 0;
    for (int k = 1; k < 4; ++k) {
        e.constant[k] = 0;
        for (int a = 0; a < 3; ++a) {
            e.gradient[k][a] = normal[k - 1][a] / det;
            e.constant[k] -= e.gradient[k][a] * e.node[0][a];
            e.gradient[0][a] -= e.gradient[k][a];
        }
        e.constant[0] -= e.constant[k];
    }
    return det;
}

template <class Real>
void setUpBox(ExactElement<Real>& e) {
    for (int a = 0; a < 3; ++a) {
        e.low[a] = e.high[a] = e.node[0][a];
        for (int k = 1; k < 4; ++k) {
            if (e.node[k][a] < e.low[a]) e.low[a] = e.node[k][a];
            if (e.node[k][a] > e.high[a]) e.high[a] = e.node[k][a];
        }
    }
}

// False when 113 bits can't promise the limits of exact_scan.h.
bool setUp(const ScanInput& input, std::int32_t element, ExactElement<Quad>& e) {
    const auto& tet = input.mesh.tets[std::size_t(element)];
    double farthest = 1;
    for (std::size_t k = 0; k < 4; ++k) {
        const auto index = quadIndexFromWorld(input.frame.lattice, input.mesh.points[std::size_t(tet[k])]);
        for (std::size_t a = 0; a < 3; ++a) {
            farthest = std::max(farthest, std::fabs(double(index[a])));
            e.node[k][a] = index[a] - Quad(e.base[a]);
        }
    }
    setUpBox(e);
    const Quad det = setUpGradients(e);
    if (det == 0) return false;
    const Quad unit = 0x1p-112;
    Quad steepest = 0, boxVolume = 1, size = 0, longest = 0;
    for (int k = 0; k < 4; ++k)
        steepest = std::max(
            steepest, absolute(e.gradient[k][0]) + absolute(e.gradient[k][1]) + absolute(e.gradient[k][2]));
    for (int a = 0; a < 3; ++a) {
        const Quad extent = e.high[a] - e.low[a];
        boxVolume *= extent;
        size += extent;
        longest = std::max(longest, extent);
    }
    e.dilation = unit * (256 * boxVolume / absolute(det) + 128 * steepest * (longest + Quad(farthest) + 2));
    return e.dilation <= Quad(kLargestSlack) && e.dilation * size <= Quad(kLargestSlackTimesSize);
}

void setUp(const ScanInput& input, std::int32_t element, ExactElement<mpq_class>& e) {
    const auto& tet = input.mesh.tets[std::size_t(element)];
    for (std::size_t k = 0; k < 4; ++k) {
        const auto index = exactIndexFromWorld(input.frame.lattice, input.mesh.points[std::size_t(tet[k])]);
        for (std::size_t a = 0; a < 3; ++a) e.node[k][a] = index[a] - mpq_class(e.base[a]);
    }
    setUpBox(e);
    setUpGradients(e);  // the caller made sure that the exact volume isn't zero
    e.dilation = 0;
}

// A channel's linear function of (s, t, r).
template <class Real>
class ExactChannel {
  public:
    ExactChannel(const ScanChannel& source, const std::array<std::int32_t, 4>& tet, std::int32_t element,
                 const ExactElement<Real>& e, int s, int t, int r) {
        low_ = std::numeric_limits<float>::infinity();
        high_ = -low_;
        double values[4];
        for (std::size_t k = 0; k < 4; ++k) {
            values[k] = source.at(source.cell ? element : tet[k]);
            const float rounded = float(values[k]);
            finite_ = finite_ && std::isfinite(rounded);
            low_ = std::min(low_, rounded);
            high_ = std::max(high_, rounded);
        }
        if (!finite_) return;
        const int axes[3] = {s, t, r};
        constant_ = values[0];
        for (int a = 0; a < 3; ++a) slope_[a] = 0;
        for (int k = 1; k < 4; ++k) {
            const Real difference = Real(values[k]) - Real(values[0]);
            constant_ += difference * e.constant[k];
            for (int a = 0; a < 3; ++a) slope_[a] += difference * e.gradient[k][axes[a]];
        }
        step_ = toDouble(slope_[0]);
    }

    // The value at the first voxel of a run; those of the others follow by a constant step, counted from it.
    double first(double s, double t, double r) const {
        if (!finite_) return 0;
        return toDouble(Real(constant_ + slope_[0] * Real(s) + slope_[1] * Real(t) + slope_[2] * Real(r)));
    }
    float at(double first, double steps) const {
        if (!finite_) return std::numeric_limits<float>::quiet_NaN();
        // A run of one voxel may stand on a slope that overflows.
        const double value = steps == 0 ? first : first + steps * step_;
        return std::clamp(float(std::clamp(value, double(low_), double(high_))), low_, high_);
    }

  private:
    bool finite_ = true;
    float low_, high_;
    Real constant_, slope_[3];
    double step_ = 0;
};

// A sum of two doubles, the second below the rounding of the first: 105 bits or so.
struct Sum {
    double high, low;
};
template <class Real>
Sum sumOf(const Real& x) {
    const double high = toDouble(x);
    return {high, std::isfinite(high) ? toDouble(Real(x - Real(high))) : 0};
}
Sum operator*(const Sum& p, double factor) {
    const double high = p.high * factor;
    return {high, std::fma(p.high, factor, -high) + p.low * factor};
}
Sum operator+(const Sum& p, const Sum& q) {
    const double sum = p.high + q.high, ofQ = sum - p.high;
    const double rest = (p.high - (sum - ofQ)) + (q.high - ofQ) + (p.low + q.low), high = sum + rest;
    return {high, rest - (high - sum)};
}

// Decides nearly all scanlines of a thin element: in double precision, or else in pairs of doubles all but
// those with an end within 2^-100 or so of a lattice point.
class RoughScanlines {
  public:
    template <class Real>
    RoughScanlines(const ExactElement<Real>& e, int s, int t, int r) {
        const Real slack = e.dilation == 0 ? 0.0 : kBoxSlack;
        add({sumOf(Real(e.low[s] - slack)), {0, 0}, {0, 0}, Side::lower});
        add({sumOf(Real(e.high[s] + slack)), {0, 0}, {0, 0}, Side::upper});
        for (int k = 0; k < 4; ++k) {
            const Real& slope = e.gradient[k][s];
            const Real by = slope == 0 ? Real(1) : Real(-slope);
            add({sumOf(Real((e.dilation + e.constant[k]) / by)), sumOf(Real(e.gradient[k][t] / by)),
                 sumOf(Real(e.gradient[k][r] / by)),
                 slope == 0  ? Side::along
                 : slope > 0 ? Side::lower
                             : Side::upper});
        }
    }

    /// True when the answer is certain: the voxels from begin to end, none when begin > end.
    bool ends(double t, double r, double& begin, double& end) const {
        const auto inDouble = [&](const Plane& p) {
            return Sum{(p.a.high + p.b.high * t) + p.c.high * r, 0};
        };
        const auto inSums = [&](const Plane& p) { return (p.a + p.b * t) + p.c * r; };
        return find(inDouble, 0x1p-48, t, r, begin, end) || find(inSums, 0x1p-100, t, r, begin, end);
    }

  private:
    enum class Side { lower, upper, along };
    /// a + b t + c r is where a face ends scanlines; of one along them, not negative where they meet it.
    struct Plane {
        Sum a, b, c;
        Side side;
    };

    // One whose solution would overflow decides nothing here.
    void add(const Plane& plane) {
        if (std::fabs(plane.a.high) + std::fabs(plane.b.high) + std::fabs(plane.c.high) < 1e200)
            planes_[std::size_t(count_++)] = plane;
        else
            isComplete_ = false;
    }

    // @param unit of the error, above the rounding of a, b, c and of the bound.
    template <class Bound>
    bool find(const Bound& boundOf, double unit, double t, double r, double& begin, double& end) const {
        constexpr double kInfinity = std::numeric_limits<double>::infinity();
        double begins[2] = {-kInfinity, -kInfinity}, lasts[2] = {kInfinity, kInfinity};  // least and most
        bool isCertain = isComplete_;
        for (int i = 0; i < count_; ++i) {
            const Plane& p = planes_[std::size_t(i)];
            const Sum bound = boundOf(p);
            // The last term is for denormal numbers.
            const double error =
                unit * (std::fabs(p.a.high) + std::fabs(p.b.high * t) + std::fabs(p.c.high * r)) + 1e-290;
            if (p.side == Side::along) {
                const double value = bound.high + bound.low;
                if (value < -error) begins[0] = kInfinity;
                isCertain &= value < -error || value > error;
                continue;
            }
            const double nearest = std::nearbyint(bound.high), beyond = (bound.high - nearest) + bound.low;
            // An error of half a voxel or more reaches other voxels; whole numbers far away have no
            // neighbours.
            const bool isNear = std::fabs(nearest) < 0x1p52 && error < 0.5;
            const double far = isNear ? 0 : error + 0x1p-50 * std::fabs(nearest) + 1;
            if (p.side == Side::lower) {
                begins[0] = std::max(begins[0], nearest - far + (beyond > error ? 1 : 0));
                begins[1] = std::max(begins[1], nearest + far + (beyond >= -error ? 1 : 0));
            } else {
                lasts[0] = std::min(lasts[0], nearest - far - (beyond <= error ? 1 : 0));
                lasts[1] = std::min(lasts[1], nearest + far - (beyond < -error ? 1 : 0));
            }
        }
        begin = begins[0];
        end = lasts[1];
        return begin > end || (isCertain && begins[0] == begins[1] && lasts[0] == lasts[1]);
    }

    std::array<Plane, 6> planes_;
    int count_ = 0;
    bool isComplete_ = true;
};

// Ends of the scanline at (t, r) along axis `s`, relative to the first voxel.
template <class Real>
bool scanlineEnds(const ExactElement<Real>& e, int s, int t, int r, double atT, double atR, double& begin,
                  double& end) {
    Real low = e.low[s] - Real(e.dilation == 0 ? 0.0 : kBoxSlack),
         high = e.high[s] + Real(e.dilation == 0 ? 0.0 : kBoxSlack);
    for (int k = 0; k < 4; ++k) {
        const Real rest =
            e.dilation + e.constant[k] + e.gradient[k][t] * Real(atT) + e.gradient[k][r] * Real(atR);
        const Real& slope = e.gradient[k][s];
        if (slope == 0) {
            if (rest < 0) return false;
            continue;
        }
        const Real bound = -rest / slope;
        if (slope > 0) {
            if (bound > low) low = bound;
        } else {
            if (bound < high) high = bound;
        }
    }
    begin = ceilToDouble(low);
    end = floorToDouble(high);
    return begin <= end;
}

template <class Real>
void walk(const ScanInput& input, const ScanOutput& output, std::int32_t element, const ExactElement<Real>& e,
          ScanCounts& counts) {
    // The longest axis is scanned: here a scanline's ends cost far more than its voxels.
    int s = 0;
    for (int a = 1; a < 3; ++a)
        if (Real(e.high[a] - e.low[a]) > Real(e.high[s] - e.low[s])) s = a;
    const int t = s == 0 ? 1 : 0, r = s == 2 ? 1 : 2;
    const double slack = e.dilation == 0 ? 0.0 : kBoxSlack;
    double from[3], to[3];
    for (int a = 0; a < 3; ++a) {
        from[a] = std::max(output.region.min[a] - e.base[a], ceilToDouble(Real(e.low[a] - Real(slack))));
        to[a] = std::min(output.region.max[a] - 1 - e.base[a], floorToDouble(Real(e.high[a] + Real(slack))));
        if (from[a] > to[a]) return;
    }
    const auto& tet = input.mesh.tets[std::size_t(element)];
    std::vector<ExactChannel<Real>> channels;
    for (const ScanChannel& source : input.channels) channels.emplace_back(source, tet, element, e, s, t, r);
    std::vector<double> first(channels.size());
    std::optional<ElementDepth> depth;
    const RoughScanlines rough(e, s, t, r);

    for (double atR = from[r]; atR <= to[r]; ++atR) {
        for (double atT = from[t]; atT <= to[t]; ++atT) {
            ++counts.scanlines;
            double begin = 0, end = 0;
            if (!rough.ends(atT, atR, begin, end) && !scanlineEnds(e, s, t, r, atT, atR, begin, end))
                continue;
            const double last = std::min(end, to[s]);
            double atS = std::max(begin, from[s]);
            if (atS > last) continue;
            for (std::size_t c = 0; c < channels.size(); ++c) first[c] = channels[c].first(begin, atT, atR);
            for (; atS <= last; ++atS) {
                Vec3i point;
                point[s] = int(std::int64_t(e.base[s]) + std::int64_t(atS));
                point[t] = int(std::int64_t(e.base[t]) + std::int64_t(atT));
                point[r] = int(std::int64_t(e.base[r]) + std::int64_t(atR));
                const std::int64_t offset = output.offset(point);
                const bool takes = coverPoint(input, output, element, offset, counts, [&] {
                    if (!depth) depth.emplace(input.mesh, input.frame, element);
                    return depth->rank(point);
                });
                if (!takes) continue;
                for (std::size_t c = 0; c < channels.size(); ++c)
                    output.values[c][offset] = channels[c].at(first[c], atS - begin);
            }
        }
    }
}

// Not further away than lattice indices are, so that indices relative to it are whole numbers in double.
void firstVoxel(const ScanInput& input, std::int32_t element, double (&base)[3]) {
    constexpr double kFarthest = 0x1p32;
    const auto& tet = input.mesh.tets[std::size_t(element)];
    for (int a = 0; a < 3; ++a) {
        base[a] = input.frame.nodes[std::size_t(tet[0])].whole[a];
        for (std::size_t k = 1; k < 4; ++k)
            base[a] = std::min(base[a], input.frame.nodes[std::size_t(tet[k])].whole[a]);
        base[a] = std::clamp(base[a], -kFarthest, kFarthest);
    }
}

bool hasRepeatedNode(const TetMesh& mesh, const std::array<std::int32_t, 4>& tet) {
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = i + 1; j < 4; ++j)
            if (tet[i] == tet[j] || mesh.points[std::size_t(tet[i])] == mesh.points[std::size_t(tet[j])])
                return true;
    return false;
}

}  // namespace

void scanElementExactly(const ScanInput& input, const ScanOutput& output, std::int32_t element,
                        ScanCounts& counts) {
    const TetMesh& mesh = input.mesh;
    const auto& tet = mesh.tets[std::size_t(element)];
    if (hasRepeatedNode(mesh, tet)) return;
    const auto corner = [&](std::size_t k) { return mesh.points[std::size_t(tet[k])]; };
    for (std::size_t k = 0; k < 4; ++k)
        for (int a = 0; a < 3; ++a)
            if (!std::isfinite(corner(k)[a])) return;
    if (volumeSign(corner(0), corner(1), corner(2), corner(3)) == 0) return;
    ++counts.exactElements;
    ExactElement<Quad> quad;
    firstVoxel(input, element, quad.base);
    if (setUp(input, element, quad)) {
        walk(input, output, element, quad, counts);
        return;
    }
    ExactElement<mpq_class> exact;
    firstVoxel(input, element, exact.base);
    setUp(input, element, exact);
    walk(input, output, element, exact, counts);
}

struct ExactScanlines::Impl {
    int s, t, r;
    std::optional<ExactElement<Quad>> quad;
    std::optional<ExactElement<mpq_class>> exact;
    std::optional<RoughScanlines> rough;
};

ExactScanlines::ExactScanlines(const ScanInput& input, std::int32_t element, int axis)
    : impl_(std::make_unique<Impl>()) {
    const int s = impl_->s = axis, t = impl_->t = axis == 0 ? 1 : 0, r = impl_->r = axis == 2 ? 1 : 2;
    impl_->quad.emplace();
    firstVoxel(input, element, impl_->quad->base);
    if (setUp(input, element, *impl_->quad)) {
        impl_->rough.emplace(*impl_->quad, s, t, r);
        return;
    }
    impl_->quad.reset();
    impl_->exact.emplace();
    firstVoxel(input, element, impl_->exact->base);
    setUp(input, element, *impl_->exact);
    impl_->rough.emplace(*impl_->exact, s, t, r);
}

ExactScanlines::~ExactScanlines() = default;

void ExactScanlines::ends(double atT, double atR, double& begin, double& end) const {
    if (impl_->rough->ends(atT, atR, begin, end)) return;
    const int s = impl_->s, t = impl_->t, r = impl_->r;
    const bool some = impl_->quad ? scanlineEnds(*impl_->quad, s, t, r, atT, atR, begin, end)
                                  : scanlineEnds(*impl_->exact, s, t, r, atT, atR, begin, end);
    if (!some) {
        begin = 1;
        end = 0;
    }
}

bool contestPoint(const ScanInput& input, const ScanOutput& output, std::int32_t element, double rank,
                  std::int64_t offset) {
    std::int32_t& owner = output.owner[offset];
    const std::int32_t present = output.ownerAt(offset);
    if (output.marks[offset] == kFollowsInRun || !(owner & kRankKnown)) {
        // The point becomes a run of its own, and so does what is left of its run.
        const Vec3i point = output.pointAt(offset);
        const std::int64_t next = offset + 1;
        if (point.x + 1 < output.region.max.x && output.marks[next] == kFollowsInRun) {
            output.marks[next] = kStartsRun;
            output.owner[next] = present;
        }
        output.marks[offset] = kStartsRun;
        owner = present | kRankKnown;
        output.rank[offset] = ElementDepth(input.mesh, input.frame, present).rank(point);
    }
    if (rank < output.rank[offset] || (rank == output.rank[offset] && element > present)) return false;
    owner = element | kRankKnown;
    output.rank[offset] = rank;
    return true;
}

}  // namespace tessera
