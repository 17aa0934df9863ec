#include "reference/reference_block.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"
#include "base/parallel.h"

namespace tessera {

namespace {

/// Two results in double closer than this are told apart by rational arithmetic.
constexpr double kClearVoxels = 1e-8;

struct Found {
    std::uint32_t offset;
    Candidate candidate;
};

/// One element with its planes in double and the bounds of their errors.
class FilteredElement {
  public:
    FilteredElement(const Oracle& oracle, std::int64_t element, double tolerance) {
        const auto& tet = oracle.mesh().tets[std::size_t(element)];
        std::array<Vec3d, 4> at;
        Box3d bounds;
        for (std::size_t i = 0; i < 4; ++i) {
            at[i] = oracle.frame().indexNode(tet[i]);
            bounds.include(at[i]);
        }
        const Vec3d size = glm::max(glm::abs(bounds.min), glm::abs(bounds.max));
        const double placeError = std::ldexp(std::max({size.x, size.y, size.z}), -50);
        const double pad = tolerance + 2 * placeError;
        box_ = Box3d{bounds.min - pad, bounds.max + pad};
        nodes_ = at;
        const Vec3d extent = box_.size();
        placeSlack_ = 16 * (2 * placeError + std::ldexp(std::max({extent.x, extent.y, extent.z}), -50));
        setPlanes(at, placeError, tolerance);
    }

    /// Lattice points that can be within the tolerance, exactly on the border of the box included.
    IndexBox points(const IndexBox& within) const {
        IndexBox result;
        for (int a = 0; a < 3; ++a) {
            const double low = std::ceil(box_.min[a]), high = std::floor(box_.max[a]) + 1;
            result.min[a] = int(std::clamp(low, double(within.min[a]), double(within.max[a])));
            result.max[a] = int(std::clamp(high, double(within.min[a]), double(within.max[a])));
        }
        return result;
    }

    enum class Verdict { out, in, doubtful };
    /// @param depth receives the depth, within kClearVoxels, when the verdict is `in`.
    Verdict judge(const Vec3d& p, double& depth) const {
        depth = std::numeric_limits<double>::infinity();
        for (const Plane& plane : planes_) {
            const double s = dot(plane.inward, p - plane.node);
            if (s < plane.outBelow) return Verdict::out;
            depth = std::min(depth, s * plane.inverseLength);
        }
        return isSound_ && depth > kClearVoxels ? Verdict::in : Verdict::doubtful;
    }

    /// Bounds of the true distance. Any point of the element gives an upper one; the nodes' least extent
    /// along any direction gives a lower one.
    void boundDistance(const Vec3d& p, double& least, double& most) const {
        std::array<Vec3d, 4> at;
        for (std::size_t i = 0; i < 4; ++i) at[i] = nodes_[i] - p;
        const Vec3d guess = nearestGuess(at);
        const double length = glm::length(guess);
        most = length + placeSlack_;
        least = 0;
        if (!(length > placeSlack_)) return;
        const Vec3d direction = guess / length;
        least = std::numeric_limits<double>::infinity();
        for (const Vec3d& q : at) least = std::min(least, dot(direction, q));
        least = std::max(0.0, least - placeSlack_);
    }

  private:
    /// The point of the element nearest to the origin, about: a good guess, not a bound.
    static Vec3d nearestGuess(const std::array<Vec3d, 4>& at) {
        Vec3d best = at[0];
        const auto offer = [&](const Vec3d& q) {
            if (dot(q, q) < dot(best, best)) best = q;
        };
        for (std::size_t i = 0; i < 4; ++i) {
            offer(at[i]);
            for (std::size_t j = i + 1; j < 4; ++j) {
                const Vec3d edge = at[j] - at[i];
                const double t = -dot(at[i], edge) / dot(edge, edge);
                if (t > 0 && t < 1) offer(at[i] + t * edge);
                for (std::size_t k = j + 1; k < 4; ++k) {
                    const Vec3d normal = cross(edge, at[k] - at[i]);
                    const double wi = dot(normal, cross(at[j], at[k])), wj = dot(normal, cross(at[k], at[i])),
                                 wk = dot(normal, cross(at[i], at[j]));
                    if (wi > 0 && wj > 0 && wk > 0)
                        offer((wi * at[i] + wj * at[j] + wk * at[k]) / (wi + wj + wk));
                }
            }
        }
        return best;
    }

    struct Plane {
        Vec3d inward{0};  ///< length: twice the face's area
        Vec3d node{0};
        double inverseLength = 0;
        double outBelow = 0;  ///< when the volume is below, the point is further out than the tolerance
    };

    void setPlanes(const std::array<Vec3d, 4>& at, double placeError, double tolerance) {
        const Vec3d extent = box_.size();
        const double length = std::max({extent.x, extent.y, extent.z});
        // Every difference of places in the box is within `slip` of the true one; a product of three of them
        // in the determinant then errs by under 18 length^2 slip from the places and 15 length^2 slip from
        // rounding.
        const double slip = 2 * placeError + std::ldexp(length, -52);
        const double volumeError = 64 * length * length * slip + 1e-280;
        const double normalError = 16 * length * slip + 1e-280;
        static constexpr std::array<std::array<std::size_t, 3>, 4> kFaces{
            {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
        isSound_ = true;
        for (std::size_t i = 0; i < 4; ++i) {
            const Vec3d a = at[kFaces[i][0]], b = at[kFaces[i][1]], c = at[kFaces[i][2]];
            Vec3d normal = cross(b - a, c - a);
            const double height = dot(normal, at[i] - a);
            if (height < 0) normal = -normal;
            const double normalLength = glm::length(normal);
            const bool isKnownSide = std::abs(height) > volumeError;
            const double outBelow = -(volumeError + tolerance * (normalLength + normalError)) * (1 + 1e-9);
            planes_[i] = {normal, a, 1 / std::max(normalLength, 1e-290),
                          isKnownSide ? outBelow : -std::numeric_limits<double>::infinity()};
            isSound_ = isSound_ && isKnownSide && volumeError < 0.1 * kClearVoxels * normalLength;
        }
    }

    Box3d box_;
    std::array<Vec3d, 4> nodes_;
    double placeSlack_ = 0;
    std::array<Plane, 4> planes_;
    bool isSound_ = false;
};

/// Decides one pair in rational arithmetic; false when the point is further away than the tolerance.
bool decideExactly(const Oracle& oracle, const FilteredElement& filter, const Vec3i& p,
                   const ReferenceOptions& options, Candidate& candidate) {
    const double tolerance = options.toleranceVoxels;
    const std::int64_t element = candidate.element;
    double least = 0, most = std::numeric_limits<double>::infinity();
    if (!options.isUnfiltered) filter.boundDistance(Vec3d(p), least, most);
    if (least > tolerance) return false;
    candidate.contains = oracle.contains(element, p);
    if (!candidate.contains) {
        if (most > tolerance || most - least > 0.1 * most) {
            const mpq_class square = oracle.nearest(element, p).squaredDistance, bound(tolerance);
            if (square > bound * bound) return false;
            candidate.distanceVoxels = std::sqrt(approximateRatio(square.get_num(), square.get_den()));
        } else {
            candidate.distanceVoxels = 0.5 * (least + most);
        }
    }
    candidate.depthVoxels = oracle.depthVoxels(element, p);
    return true;
}

std::uint32_t offsetIn(const IndexBox& box, const Vec3i& p) {
    const Vec3i n = box.size(), q = p - box.min;
    return (std::uint32_t(q.z) * std::uint32_t(n.y) + std::uint32_t(q.y)) * std::uint32_t(n.x) +
           std::uint32_t(q.x);
}

/// The candidates among the points of one element.
std::int64_t findPoints(const Oracle& oracle, std::int64_t element, const IndexBox& box,
                        const ReferenceOptions& options, std::vector<Found>& found) {
    const FilteredElement filter(oracle, element, options.toleranceVoxels);
    const IndexBox points = filter.points(box);
    if (points.empty() || oracle.volumeSign(element) == 0) return 0;
    std::int64_t exactPairs = 0;
    Vec3i p;
    for (p.z = points.min.z; p.z < points.max.z; ++p.z)
        for (p.y = points.min.y; p.y < points.max.y; ++p.y)
            for (p.x = points.min.x; p.x < points.max.x; ++p.x) {
                Candidate candidate{std::int32_t(element), true, 0, 0};
                auto verdict = FilteredElement::Verdict::doubtful;
                if (!options.isUnfiltered) verdict = filter.judge(Vec3d(p), candidate.depthVoxels);
                if (verdict == FilteredElement::Verdict::out) continue;
                if (verdict == FilteredElement::Verdict::doubtful) {
                    ++exactPairs;
                    if (!decideExactly(oracle, filter, p, options, candidate)) continue;
                }
                found.push_back({offsetIn(box, p), candidate});
            }
    return exactPairs;
}

}  // namespace

ReferenceBlock referenceBlock(const Oracle& oracle, const IndexBox& box, const ReferenceOptions& options,
                              const Execution& execution) {
    TESSERA_CHECK(box.count() < (std::int64_t(1) << 31), "a reference block is too large");
    const std::int64_t elements = oracle.mesh().elementCount(), chunk = 256;
    std::vector<std::vector<Found>> found(std::size_t((elements + chunk - 1) / chunk));
    std::vector<std::int64_t> exactPairs(found.size(), 0);
    parallelForChunks(execution, elements, chunk, [&](std::int64_t begin, std::int64_t end) {
        const auto c = std::size_t(begin / chunk);
        for (std::int64_t e = begin; e < end; ++e)
            exactPairs[c] += findPoints(oracle, e, box, options, found[c]);
    });

    ReferenceBlock result;
    result.box = box;
    result.toleranceVoxels = options.toleranceVoxels;
    result.mustCover.assign(std::size_t(box.count()), 0);
    result.firstCandidate.assign(std::size_t(box.count()) + 1, 0);
    for (const auto& list : found)
        for (const Found& f : list) ++result.firstCandidate[f.offset + 1];
    for (std::size_t i = 1; i < result.firstCandidate.size(); ++i)
        result.firstCandidate[i] += result.firstCandidate[i - 1];
    result.candidates.resize(result.firstCandidate.back());
    std::vector<std::uint32_t> next(result.firstCandidate.begin(), result.firstCandidate.end() - 1);
    for (const auto& list : found)
        for (const Found& f : list) {
            result.candidates[next[f.offset]++] = f.candidate;
            result.mustCover[f.offset] |= f.candidate.contains;
        }
    for (const std::int64_t pairs : exactPairs) result.exactPairs += pairs;
    return result;
}

}  // namespace tessera
