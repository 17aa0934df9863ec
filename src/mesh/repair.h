#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "mesh/change_judge.h"
#include "mesh/element_class.h"
#include "mesh/field_range.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

struct RepairOptions {
    ClassLimits limits;  ///< minAspect in [1e-12, 0.5], maxDihedralDegrees in [90, 180)
    /// What all operations together may lose or gain of the mesh's volume, as a share of it, in [0, 1].
    double maxVolumeLoss = 1e-6;
};

/// What a repair did. Elements are counted; lengths and volumes are in world units.
struct RepairReport {
    ClassCounts before, after;
    std::int64_t elementsBefore = 0, elementsAfter = 0;
    std::int64_t nodesBefore = 0, nodesAfter = 0;
    std::int64_t inverted = 0;        ///< elements of negative orientation, turned to positive
    std::int64_t collapses = 0;       ///< of edges
    std::int64_t edgeSplits = 0;      ///< of one edge, and a collapse
    std::int64_t edgePairSplits = 0;  ///< of two crossing edges, and a collapse
    std::int64_t faceSplits = 0;      ///< and a collapse
    std::int64_t dropped = 0;         ///< elements at the boundary taken away, with their volume
    std::int64_t droppedFlat = 0;     ///< elements of zero volume taken away without another change
    std::int64_t unmatchedFlat = 0;   ///< of these, such whose neighbours' faces now meet without matching
    std::array<std::int64_t, kRefusals> refused{};       ///< operations looked at and refused, by reason
    std::array<std::int64_t, kRefusals> kept{};          ///< degenerate elements that stay, by reason
    double keptVolumeWorld = 0;                          ///< of these
    double volumeBeforeWorld = 0, volumeAfterWorld = 0;  ///< sum of the elements' |volume|
    double volumeChangeWorld = 0;  ///< sum of what single operations lost or gained; within the bound
    /// how far a place of the boundary can have moved, all steps together
    double boundaryDeviationWorld = 0;

    struct FieldRange {
        std::string field;
        int component = 0;
        ValueRange before, after;
    };
    std::vector<FieldRange> ranges;  ///< only when something was repaired

    bool changed() const { return inverted > 0 || before.degenerate() > 0; }
    std::int64_t keptElements() const { return after.degenerate(); }
    /// |after - before| over before; 0 when there was none.
    double relativeVolumeChange() const;
    bool rangesGrew() const;
};

/// Removes degenerate elements by collapsing them into their neighbours, and turns all elements to positive
/// orientation. Without either the mesh comes back as it was. After: Museth and Lombeyda 2004 (see
/// element_class.h): needles collapse the shortest edge; spindles split the edge opposite to the large angle,
/// slivers both edges, caps the face, and collapse the short edge that results. Worst elements first.
///
/// No element is inverted, and none becomes worse than the worst one around was. Volume inside the mesh goes
/// to the neighbours. The boundary moves by at most 4 minAspect times the element's longest edge an
/// operation; elements at the boundary that no such operation removes are taken away, as long as the bound on
/// volume allows. What is left is counted with the reason. New nodes take linearly interpolated field values,
/// new elements the cell values of the one that they are part of, so no field's range grows. Nodes that no
/// element uses any more are left out. Results don't depend on threads. Throws InputError for options out of
/// range.
TetMesh repair(TetMesh mesh, const RepairOptions& options, RepairReport& report, const Execution& execution);

}  // namespace tessera
