#include "mesh/change_judge.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mesh/geometry.h"
#include "mesh/precise_volume.h"

namespace tessera {

namespace {

using Triangle = std::array<Vec3d, 3>;

double distanceToSegment(const Vec3d& p, const Vec3d& a, const Vec3d& b) {
    const Vec3d edge = b - a, w = p - a;
    const double length2 = glm::dot(edge, edge);
    const double t = length2 > 0 ? std::clamp(glm::dot(w, edge) / length2, 0.0, 1.0) : 0;
    return glm::length(w - t * edge);
}

double distanceToTriangle(const Vec3d& p, const Triangle& t) {
    double distance = std::min({distanceToSegment(p, t[0], t[1]), distanceToSegment(p, t[1], t[2]),
                                distanceToSegment(p, t[2], t[0])});
    const Vec3d normal = glm::cross(t[1] - t[0], t[2] - t[0]);
    const double length = glm::length(normal);
    if (!(length > 0)) return distance;
    for (std::size_t i = 0; i < 3; ++i)
        if (glm::dot(glm::cross(t[(i + 1) % 3] - t[i], p - t[i]), normal) < 0) return distance;
    return std::min(distance, std::fabs(glm::dot(p - t[0], normal)) / length);
}

/// Largest distance from corners, edge middles and centroids of some triangles to other triangles; infinite
/// when there are none.
double oneSidedDistance(const std::vector<Triangle>& from, const std::vector<Triangle>& to) {
    double largest = 0;
    const auto include = [&](const Vec3d& p) {
        double nearest = std::numeric_limits<double>::infinity();
        for (const Triangle& t : to) nearest = std::min(nearest, distanceToTriangle(p, t));
        largest = std::max(largest, nearest);
    };
    for (const Triangle& t : from) {
        include(t[0] + ((t[1] - t[0]) + (t[2] - t[0])) / 3.0);
        for (std::size_t i = 0; i < 3; ++i) {
            include(t[i]);
            include(t[i] + 0.5 * (t[(i + 1) % 3] - t[i]));
        }
    }
    return largest;
}

template <class Visit>
void forEachFace(const Tet& tet, const Visit& visit) {
    for (std::size_t skip = 0; skip < 4; ++skip) {
        std::array<std::int32_t, 3> face;
        std::size_t count = 0;
        for (std::size_t i = 0; i < 4; ++i)
            if (i != skip) face[count++] = tet[i];
        std::sort(face.begin(), face.end());
        visit(face);
    }
}

}  // namespace

const char* nameOf(Refusal refusal) {
    constexpr std::array<const char*, kRefusals> kNames{"shape",   "conformity", "inversion",
                                                        "quality", "boundary",   "volume"};
    return kNames[std::size_t(refusal)];
}

Vec3d ChangeJudge::pointOf(std::int32_t node, const Change& change) const {
    return node == complex_.nodeCount() ? change.newNode.pointWorld : complex_.point(node);
}

Corners ChangeJudge::cornersOf(const Tet& tet, const Change& change) const {
    return {pointOf(tet[0], change), pointOf(tet[1], change), pointOf(tet[2], change),
            pointOf(tet[3], change)};
}

/// A flat element may stay flat: it takes part in no volume.
bool ChangeJudge::keepsOrientation(const Change& change) const {
    for (const Change::Added& added : change.added) {
        const Corners c = cornersOf(added.tet, change);
        const int sign = volumeSign(c[0], c[1], c[2], c[3]);
        if (sign < 0) return false;
        if (sign > 0) continue;
        const Corners p = cornersOf(complex_.tet(added.parent), change);
        if (volumeSign(p[0], p[1], p[2], p[3]) != 0) return false;
    }
    return true;
}

bool ChangeJudge::keepsQuality(const Change& change, const ChangeLimits& limits, Verdict& verdict) const {
    std::size_t before = 0, after = 0;
    double worstBefore = 1;
    for (const std::int32_t e : change.removed) {
        const double aspect = aspectOf(cornersOf(complex_.tet(e), change));
        before += aspect < limits.minAspect;
        worstBefore = std::min(worstBefore, aspect);
    }
    for (const Change::Added& added : change.added) {
        const double aspect = aspectOf(cornersOf(added.tet, change));
        after += aspect < limits.minAspect;
        verdict.worstAspect = std::min(verdict.worstAspect, aspect);
    }
    return after < before && (after == 0 || verdict.worstAspect >= worstBefore);
}

bool ChangeJudge::keepsConformity(const Change& change) {
    uses_.clear();
    for (const std::int32_t e : change.removed)
        forEachFace(complex_.tet(e), [&](const Face& face) { uses_.push_back({face, 1, 0}); });
    for (const Change::Added& added : change.added)
        forEachFace(added.tet, [&](const Face& face) { uses_.push_back({face, 0, 1}); });
    std::sort(uses_.begin(), uses_.end(), [](const FaceUse& a, const FaceUse& b) { return a.face < b.face; });
    std::size_t count = 0;
    for (std::size_t i = 0; i < uses_.size(); ++i) {
        if (count > 0 && uses_[count - 1].face == uses_[i].face) {
            uses_[count - 1].before += uses_[i].before;
            uses_[count - 1].after += uses_[i].after;
        } else {
            uses_[count++] = uses_[i];
        }
    }
    uses_.resize(count);

    oldBoundary_.clear();
    newBoundary_.clear();
    for (const FaceUse& use : uses_) {
        const bool isNew = use.face[2] == complex_.nodeCount();
        const int outside = isNew ? 0 : complex_.faceUsers(use.face) - use.before;
        const int before = outside + use.before, after = outside + use.after;
        if (before == after) continue;
        // Elements that don't change keep their neighbours, and get no others.
        if (outside > 0 || after > 2) return false;
        if (before == 1) oldBoundary_.push_back(use.face);
        if (after == 1) newBoundary_.push_back(use.face);
    }
    return true;
}

double ChangeJudge::deviation(const Change& change) const {
    if (oldBoundary_.empty() && newBoundary_.empty()) return 0;
    const auto triangles = [&](const std::vector<Face>& faces) {
        std::vector<Triangle> list;
        for (const Face& f : faces)
            list.push_back({pointOf(f[0], change), pointOf(f[1], change), pointOf(f[2], change)});
        return list;
    };
    const std::vector<Triangle> before = triangles(oldBoundary_), after = triangles(newBoundary_);
    return std::max(oneSidedDistance(before, after), oneSidedDistance(after, before));
}

double ChangeJudge::volumeLoss(const Change& change) const {
    double difference = 0;
    for (const std::int32_t e : change.removed)
        difference += preciseVolume(cornersOf(complex_.tet(e), change));
    for (const Change::Added& added : change.added) difference -= preciseVolume(cornersOf(added.tet, change));
    return std::fabs(difference);
}

Verdict ChangeJudge::judge(const Change& change, const ChangeLimits& limits) {
    Verdict verdict;
    const auto refuse = [&](Refusal refusal) {
        verdict.refusal = refusal;
        return verdict;
    };
    if (!keepsQuality(change, limits, verdict)) return refuse(Refusal::quality);
    if (!keepsOrientation(change)) return refuse(Refusal::inversion);
    if (!keepsConformity(change)) return refuse(Refusal::conformity);
    verdict.deviationWorld = deviation(change);
    if (!(verdict.deviationWorld <= limits.maxDeviationWorld)) return refuse(Refusal::boundary);
    verdict.lossWorld = volumeLoss(change);
    if (!(verdict.lossWorld <= limits.maxLossWorld)) return refuse(Refusal::volume);
    verdict.allowed = true;
    return verdict;
}

}  // namespace tessera
