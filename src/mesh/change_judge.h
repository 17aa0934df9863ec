#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mesh/element_merge.h"

namespace tessera {

/// Why an operation is refused, from the least telling to the most.
enum class Refusal : std::uint8_t {
    shape,       ///< there is none: the element's parts don't face each other
    conformity,  ///< a face would be left without its neighbour, or get one too many
    inversion,   ///< an element would turn inside out or become flat
    quality,     ///< elements around would become degenerate
    boundary,    ///< the boundary would move too far
    volume,      ///< more volume would be lost than is allowed
};
inline constexpr std::size_t kRefusals = 6;
const char* nameOf(Refusal refusal);

struct ChangeLimits {
    double minAspect = 0;
    double maxDeviationWorld = 0;
    double maxLossWorld = 0;  ///< volume
};

struct Verdict {
    bool allowed = false;
    Refusal refusal = Refusal::conformity;
    double deviationWorld = 0;  ///< largest distance between the old and the new boundary
    double lossWorld = 0;       ///< volume lost or gained
    double worstAspect = 1;     ///< of the elements added
};

/// Whether a change keeps the mesh sound: every inner face keeps its two elements, no element turns inside
/// out or becomes flat (exact predicate), fewer elements are degenerate afterwards and none is worse than
/// the worst was, and boundary and volume stay within the limits.
class ChangeJudge {
  public:
    explicit ChangeJudge(const TetComplex& complex) : complex_(complex) {}
    Verdict judge(const Change& change, const ChangeLimits& limits);

  private:
    using Face = std::array<std::int32_t, 3>;
    struct FaceUse {
        Face face;
        int before = 0, after = 0;  ///< elements of the change that have it
    };

    Vec3d pointOf(std::int32_t node, const Change& change) const;
    Corners cornersOf(const Tet& tet, const Change& change) const;
    bool keepsOrientation(const Change& change) const;
    bool keepsQuality(const Change& change, const ChangeLimits& limits, Verdict& verdict) const;
    bool keepsConformity(const Change& change);
    double deviation(const Change& change) const;
    double volumeLoss(const Change& change) const;

    const TetComplex& complex_;
    std::vector<FaceUse> uses_;
    std::vector<Face> oldBoundary_, newBoundary_;  ///< only what differs
};

}  // namespace tessera
