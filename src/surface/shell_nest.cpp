#include "surface/shell_nest.h"

#include <gmpxx.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "mesh/geometry.h"
#include "surface/exact_normal.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Triangles and shells looked at in all, more than any surface takes that isn't made to take long.
constexpr std::int64_t kLooksPerTriangle = 200, kMoreLooks = 50'000'000;
/// A shell's triangles from which a place inside is looked for, when the first ones gave none.
constexpr std::size_t kMostTries = 64;

bool contains(const Box3d& outer, const Box3d& inner) {
    return glm::min(outer.min, inner.min) == outer.min && glm::max(outer.max, inner.max) == outer.max;
}

/// Six times the volume under a shell, exactly.
mpq_class exactVolume(const Surface& surface, std::span<const std::int32_t> triangles) {
    mpq_class sum = 0;
    for (const std::int32_t triangle : triangles) {
        mpq_class p[3][3];
        const TriangleCorners corners = cornersOf(surface, triangle);
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k) p[i][k] = corners[std::size_t(i)][k];
        for (int k = 0; k < 3; ++k) {
            const int u = (k + 1) % 3, v = (k + 2) % 3;
            sum += p[0][k] * (p[1][u] * p[2][v] - p[1][v] * p[2][u]);
        }
    }
    return sum;
}

double signedVolume(const Surface& surface, std::span<const std::int32_t> triangles) {
    const Vec3d origin = cornersOf(surface, triangles.front())[0];
    double sum = 0, size = 0, bound = 0;
    for (const std::int32_t triangle : triangles) {
        const TriangleCorners t = cornersOf(surface, triangle);
        const SixfoldVolume sixfold = sixfoldVolume(origin, t[0], t[1], t[2]);
        sum += sixfold.value;
        size += std::fabs(sixfold.value);
        bound += sixfold.errorBound;
    }
    // Each sum loses half an ulp of what it has at most; twice that for the rounding of the bounds.
    if (std::fabs(sum) > 2 * (bound + double(triangles.size()) * 0x1p-53 * size)) return sum / 6;
    const mpq_class exact = exactVolume(surface, triangles);
    const double rounded = std::fabs(mpq_class(exact / 6).get_d());
    // No volume is beyond what a double can say, so that the sign stays.
    const double finite =
        std::clamp(rounded, std::numeric_limits<double>::min(), std::numeric_limits<double>::max());
    return sgn(exact) * finite;
}

double areaOf(const TriangleCorners& t) {
    const double area = glm::length(glm::cross(t[1] - t[0], t[2] - t[0]));
    return std::isfinite(area) ? area : 0;
}

}  // namespace

ShellNest::ShellNest(const TriangleTree& tree, std::span<const std::int32_t> shellOf, std::size_t shells,
                     const Execution& execution)
    : tree_(tree), shellOf_(shellOf), begin_(shells + 1, 0), boxes_(shells) {
    for (const std::int32_t shell : shellOf)
        if (shell >= 0) ++begin_[std::size_t(shell) + 1];
    for (std::size_t s = 0; s < shells; ++s) begin_[s + 1] += begin_[s];
    byShell_.resize(std::size_t(begin_.back()));
    std::vector<std::int64_t> cursor = begin_;
    for (std::size_t t = 0; t < shellOf.size(); ++t)
        if (shellOf[t] >= 0) byShell_[std::size_t(cursor[std::size_t(shellOf[t])]++)] = std::int32_t(t);
    parallelFor(execution, std::int64_t(shells), [&](std::int64_t s) {
        for (const std::int32_t triangle : trianglesOf(std::size_t(s)))
            boxes_[std::size_t(s)].include(tree_.boxOf(triangle));
    });
}

std::vector<double> ShellNest::volumesWorld(const Execution& execution) const {
    std::vector<double> volumes(boxes_.size());
    parallelFor(execution, std::int64_t(volumes.size()), [&](std::int64_t s) {
        volumes[std::size_t(s)] = signedVolume(tree_.surface(), trianglesOf(std::size_t(s)));
    });
    return volumes;
}

void ShellNest::count(std::int64_t looked) const {
    const std::int64_t most = kLooksPerTriangle * tree_.count() + kMoreLooks;
    if (looked_.fetch_add(looked, std::memory_order_relaxed) + looked > most)
        throw InputError("the surface's " + std::to_string(boxes_.size()) +
                         " parts overlap too much to find out which lies in which");
}

/// Exact, for a line that is infinitesimally beside the place, so that it meets no corner or edge: as a
/// polygon's crossings are counted, where one coordinate of the place counts as a little larger, and the
/// other as larger by much more than that.
ShellNest::Standing ShellNest::standingOf(std::int32_t triangle, int axis, const Vec3d& place) const {
    const TriangleCorners t = cornersOf(tree_.surface(), triangle);
    const int v = (axis + 2) % 3;
    bool onLine = false;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3d &a = t[k], &b = t[(k + 1) % 3];
        if ((a[v] > place[v]) == (b[v] > place[v])) continue;
        const bool rises = b[v] > a[v];
        if (normalSign(axis, rises ? a : b, rises ? b : a, place) > 0) onLine = !onLine;
    }
    if (!onLine) return Standing::beside;
    const int side = volumeSign(t[0], t[1], t[2], place) * normalSign(axis, t[0], t[1], t[2]);
    return side < 0 ? Standing::behind : side > 0 ? Standing::before : Standing::at;
}

ShellNest::Gap ShellNest::gapAt(std::size_t shell, int axis, const Vec3d& place,
                                std::int32_t exceptTriangle) const {
    // What bounds the inside of a shell is in the shell's box. A short line comes first, as many shells in
    // one another have many triangles on the long one.
    const double lowest = boxes_[shell].min[axis], highest = boxes_[shell].max[axis];
    for (double part = 1.0 / 64; part < 1; part *= 8) {
        const double reach = part * highest - part * lowest;
        const double low = std::max(lowest, place[axis] - reach);
        const double high = std::min(highest, place[axis] + reach);
        const Gap gap = gapAlong(axis, place, low, high, exceptTriangle);
        if (gap.low >= low && gap.high <= high) return gap;
    }
    return gapAlong(axis, place, lowest, highest, exceptTriangle);
}

/// As far as triangles meet the line from `lowest` to `highest`.
ShellNest::Gap ShellNest::gapAlong(int axis, const Vec3d& place, double lowest, double highest,
                                   std::int32_t exceptTriangle) const {
    constexpr double kInfinite = std::numeric_limits<double>::infinity();
    Gap gap{-kInfinite, kInfinite};
    Box3d line{place, place};
    line.min[axis] = lowest;
    line.max[axis] = highest;
    std::int64_t looked = 0;
    tree_.visitOverlaps(line, [&](std::int64_t at) {
        ++looked;
        const std::int32_t triangle = tree_.triangleAt(at);
        if (triangle == exceptTriangle || shellOf_[std::size_t(triangle)] < 0) return;
        const Standing standing = standingOf(triangle, axis, place);
        if (standing == Standing::beside) return;
        const TriangleCorners t = cornersOf(tree_.surface(), triangle);
        const Vec3d normal = glm::cross(t[1] - t[0], t[2] - t[0]);
        Vec3d offset = place - t[0];
        offset[axis] = 0;
        const Box3d box = tree_.boxOf(triangle);
        double meets = t[0][axis] - glm::dot(offset, normal) / normal[axis];
        if (!std::isfinite(meets)) meets = middleOf(box.min, box.max)[axis];
        meets = std::clamp(meets, box.min[axis], box.max[axis]);
        if (standing != Standing::before) gap.high = std::min(gap.high, std::max(meets, place[axis]));
        if (standing != Standing::behind) gap.low = std::max(gap.low, std::min(meets, place[axis]));
    });
    count(looked);
    return gap;
}

/// Shells of which the ray from a place along x to `farthest` meets an odd number of triangles, ascending:
/// those that the place is in, of those that the ray leaves.
std::vector<std::int32_t> ShellNest::oddShells(const Vec3d& place, double farthest) const {
    std::vector<std::int32_t> met;
    std::int64_t looked = 0;
    tree_.visitOverlaps({place, {farthest, place.y, place.z}}, [&](std::int64_t at) {
        ++looked;
        const std::int32_t triangle = tree_.triangleAt(at);
        const std::int32_t shell = shellOf_[std::size_t(triangle)];
        if (shell >= 0 && standingOf(triangle, 0, place) == Standing::behind) met.push_back(shell);
    });
    count(looked);
    std::sort(met.begin(), met.end());
    std::vector<std::int32_t> odd;
    for (const std::int32_t shell : met)
        if (!odd.empty() && odd.back() == shell)
            odd.pop_back();
        else
            odd.push_back(shell);
    return odd;
}

/// A place of the shell where no other shell is, as exactly as it can be told.
Vec3d ShellNest::ownPlace(std::size_t shell, std::span<const std::int32_t> shellOfPoint) const {
    const Surface& surface = tree_.surface();
    std::int32_t largest = trianglesOf(shell).front();
    double largestArea = 0;
    for (const std::int32_t triangle : trianglesOf(shell)) {
        for (const std::int32_t point : surface.triangles[std::size_t(triangle)])
            if (shellOfPoint[std::size_t(point)] == std::int32_t(shell))
                return surface.points[std::size_t(point)];
        const double area = areaOf(cornersOf(surface, triangle));
        if (area > largestArea) largest = triangle, largestArea = area;
    }
    // All its points are points of other shells too.
    return middleOf(cornersOf(surface, largest));
}

std::vector<std::vector<std::int32_t>> ShellNest::shellsAround(const Execution& execution) const {
    constexpr std::int32_t kUnused = -1, kSeveral = -2;
    std::vector<std::int32_t> shellOfPoint(tree_.surface().points.size(), kUnused);
    for (std::size_t s = 0; s < boxes_.size(); ++s)
        for (const std::int32_t triangle : trianglesOf(s))
            for (const std::int32_t point : tree_.surface().triangles[std::size_t(triangle)]) {
                std::int32_t& of = shellOfPoint[std::size_t(point)];
                of = of == kUnused || of == std::int32_t(s) ? std::int32_t(s) : kSeveral;
            }
    const BoxTree shells(boxes_, execution);
    std::vector<std::vector<std::int32_t>> around(boxes_.size());
    parallelFor(execution, std::int64_t(boxes_.size()), [&](std::int64_t index) {
        const auto s = std::size_t(index);
        std::vector<std::int32_t> boxesAround;
        std::int64_t looked = 0;
        double farthest = boxes_[s].min.x;
        shells.visitOverlaps({boxes_[s].min, boxes_[s].min}, [&](std::int64_t at) {
            ++looked;
            const std::int32_t other = shells.order()[std::size_t(at)];
            if (other == index || !contains(boxes_[std::size_t(other)], boxes_[s])) return;
            boxesAround.push_back(other);
            farthest = std::max(farthest, boxes_[std::size_t(other)].max.x);
        });
        count(looked);
        if (boxesAround.empty()) return;
        std::sort(boxesAround.begin(), boxesAround.end());
        const std::vector<std::int32_t> odd = oddShells(ownPlace(s, shellOfPoint), farthest);
        std::set_intersection(odd.begin(), odd.end(), boxesAround.begin(), boxesAround.end(),
                              std::back_inserter(around[s]));
    });
    return around;
}

bool ShellNest::isInside(std::size_t shell, const Vec3d& place, std::span<const std::int32_t> around) const {
    const std::vector<std::int32_t> odd = oddShells(place, boxes_[shell].max.x);
    bool inside = false;
    for (const std::int32_t other : odd) {
        if (other == std::int32_t(shell))
            inside = true;
        else if (contains(boxes_[shell], boxes_[std::size_t(other)]) &&
                 !std::binary_search(around.begin(), around.end(), other))
            return false;  // in a shell that lies in this one
    }
    return inside;
}

/// Goes from the middle of a triangle half the way inwards to the next one, and from there to the middle
/// between what lies along each axis.
ShellNest::Candidate ShellNest::candidateAt(std::size_t shell, std::int32_t triangle, int inwards,
                                            std::span<const std::int32_t> around) const {
    const TriangleCorners t = cornersOf(tree_.surface(), triangle);
    const int axis = mainAxis(t);
    Vec3d place = middleOf(t);
    const Gap first = gapAt(shell, axis, place, triangle);
    const int way = normalSign(axis, t[0], t[1], t[2]) * inwards;
    const double next = way > 0 ? first.high : first.low;
    if (!std::isfinite(next)) return {};
    place[axis] = 0.5 * place[axis] + 0.5 * next;
    double clearance = std::numeric_limits<double>::max();
    for (int step = 1; step <= 6; ++step) {
        const int k = (axis + step) % 3;
        const Gap gap = gapAt(shell, k, place, -1);
        if (!std::isfinite(gap.low) || !std::isfinite(gap.high)) return {};
        if (step <= 3)
            place[k] = 0.5 * gap.low + 0.5 * gap.high;
        else
            clearance = std::min({clearance, place[k] - gap.low, gap.high - place[k]});
    }
    if (!(clearance > 0) || !isInside(shell, place, around)) return {};
    return {place, clearance};
}

Vec3d ShellNest::placeInside(std::size_t shell, int inwards, std::span<const std::int32_t> around) const {
    const std::span<const std::int32_t> triangles = trianglesOf(shell);
    const auto largestOf = [&](std::span<const std::int32_t> run) {
        std::int32_t largest = run.front();
        double largestArea = -1;
        for (const std::int32_t triangle : run) {
            const double area = areaOf(cornersOf(tree_.surface(), triangle));
            if (area > largestArea) largest = triangle, largestArea = area;
        }
        return largest;
    };
    Candidate best;
    for (std::size_t tries = boxes_.size() <= 100 ? 16 : 4; tries <= kMostTries && best.clearance < 0;
         tries *= 4) {
        const std::size_t runs = std::min(tries, triangles.size());
        for (std::size_t r = 0; r < runs; ++r) {
            const std::size_t begin = r * triangles.size() / runs, end = (r + 1) * triangles.size() / runs;
            const Candidate candidate =
                candidateAt(shell, largestOf(triangles.subspan(begin, end - begin)), inwards, around);
            if (candidate.clearance > best.clearance) best = candidate;
        }
    }
    return best.clearance < 0 ? middleOf(cornersOf(tree_.surface(), largestOf(triangles))) : best.place;
}

std::vector<Vec3d> ShellNest::placesInside(const std::vector<double>& volumesWorld,
                                           const std::vector<std::vector<std::int32_t>>& around,
                                           const Execution& execution) const {
    std::vector<Vec3d> places(boxes_.size());
    parallelFor(execution, std::int64_t(places.size()), [&](std::int64_t s) {
        const auto shell = std::size_t(s);
        places[shell] = placeInside(shell, volumesWorld[shell] > 0 ? -1 : 1, around[shell]);
    });
    return places;
}

}  // namespace tessera
