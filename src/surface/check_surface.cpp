#include "surface/check_surface.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "base/text.h"
#include "mesh/mesh_quality.h"
#include "surface/crossing_search.h"
#include "surface/exact_normal.h"
#include "surface/shell_nest.h"
#include "surface/surface_edges.h"
#include "surface/unfit_triangles.h"

namespace tessera {

namespace {

/// Triangles that a finding names.
constexpr std::size_t kNamedTriangles = 10;
/// Triangles that a sentence names.
constexpr std::size_t kSpokenTriangles = 10;

/// Makes a finding of faults that come in any order.
class FaultCounter {
  public:
    explicit FaultCounter(SurfaceFault fault) { finding_.fault = fault; }

    void involve(std::int32_t triangle, const Vec3d& placeWorld) {
        std::vector<std::int64_t>& named = finding_.triangles;
        if (named.empty() || triangle < named.front()) finding_.placeWorld = placeWorld;
        const auto at = std::lower_bound(named.begin(), named.end(), triangle);
        if (at != named.end() && *at == triangle) return;
        named.insert(at, triangle);
        if (named.size() > kNamedTriangles) named.pop_back();
    }
    void involveAll(std::span<const EdgeUse> users, const Vec3d& placeWorld) {
        for (const EdgeUse& use : users) involve(use.triangle, placeWorld);
    }
    void count(std::int64_t more = 1) { finding_.count += more; }
    void appendTo(std::vector<SurfaceFinding>& findings) const {
        if (finding_.count > 0) findings.push_back(finding_);
    }

  private:
    SurfaceFinding finding_;
};

/// The marked triangles as faults.
void findMarked(SurfaceFault fault, const Surface& surface, const std::vector<std::uint8_t>& marked,
                std::vector<SurfaceFinding>& findings) {
    FaultCounter counter(fault);
    for (std::size_t t = 0; t < marked.size(); ++t) {
        if (!marked[t]) continue;
        counter.count();
        counter.involve(std::int32_t(t), middleOf(cornersOf(surface, std::int64_t(t))));
    }
    counter.appendTo(findings);
}

Vec3d middleOfEdge(const Surface& surface, const EdgeUse& edge) {
    return middleOf(surface.points[std::size_t(edge.low)], surface.points[std::size_t(edge.high)]);
}

void findEdgeFaults(const Surface& surface, std::span<const EdgeUse> uses,
                    std::vector<SurfaceFinding>& findings) {
    FaultCounter nonManifold(SurfaceFault::nonManifold), open(SurfaceFault::open);
    forEachEdge(uses, [&](std::span<const EdgeUse> users) {
        if (users.size() == 2) return;
        FaultCounter& counter = users.size() > 2 ? nonManifold : open;
        counter.count();
        counter.involveAll(users, middleOfEdge(surface, users[0]));
    });
    nonManifold.appendTo(findings);
    open.appendTo(findings);
}

void findTurned(const Surface& surface, std::span<const EdgeUse> uses, const SurfaceParts& found,
                std::vector<SurfaceFinding>& findings) {
    const auto isOrientable = [&](std::size_t triangle) {
        return found.parts[std::size_t(found.partOf[triangle])].orientable;
    };
    FaultCounter nonOrientable(SurfaceFault::nonOrientable);
    nonOrientable.count(std::count_if(found.parts.begin(), found.parts.end(),
                                      [](const SurfacePart& part) { return !part.orientable; }));
    forEachEdge(uses, [&](std::span<const EdgeUse> users) {
        if (users.size() != 2 || isOrientable(std::size_t(users[0].triangle))) return;
        const bool alike =
            found.turned[std::size_t(users[0].triangle)] == found.turned[std::size_t(users[1].triangle)];
        // Both run the same way, even if those that are marked were turned.
        if ((users[0].rises == users[1].rises) == alike)
            nonOrientable.involveAll(users, middleOfEdge(surface, users[0]));
    });
    nonOrientable.appendTo(findings);

    std::vector<std::uint8_t> turned = found.turned;
    for (std::size_t t = 0; t < turned.size(); ++t)
        if (turned[t] && !isOrientable(t)) turned[t] = 0;
    findMarked(SurfaceFault::turned, surface, turned, findings);
}

void findCrossingTriangles(const TriangleTree& tree, const Execution& execution,
                           std::vector<SurfaceFinding>& findings) {
    const Crossings crossings = findCrossings(tree, {}, execution);
    FaultCounter counter(SurfaceFault::crossing);
    counter.count(crossings.pairs);
    std::size_t named = 0;
    for (std::size_t t = 0; t < crossings.crosses.size() && named < kNamedTriangles; ++t) {
        if (!crossings.crosses[t]) continue;
        counter.involve(std::int32_t(t), named == 0 ? placeOfCrossing(tree, std::int32_t(t)) : Vec3d(0));
        ++named;
    }
    counter.appendTo(findings);
}

/// Of a surface that has no faults but for triangles left out.
SurfaceShells measureShells(const TriangleTree& tree, SurfaceParts found,
                            std::vector<SurfaceFinding>& findings, const Execution& execution) {
    SurfaceShells measured{{}, std::move(found.partOf)};
    const ShellNest nest(tree, measured.shellOf, found.parts.size(), execution);
    const std::vector<double> volumes = nest.volumesWorld(execution);
    const auto around = nest.shellsAround(execution);
    FaultCounter inverted(SurfaceFault::inverted);
    for (std::size_t s = 0; s < volumes.size(); ++s) {
        const SurfacePart& part = found.parts[s];
        std::int32_t parent = -1;
        for (const std::int32_t other : around[s])
            if (parent < 0 || around[std::size_t(other)].size() > around[std::size_t(parent)].size())
                parent = other;
        measured.shells.push_back(
            {part.firstTriangle, part.triangles, volumes[s], int(around[s].size()), parent, Vec3d(0)});
        if (!around[s].empty() || volumes[s] > 0) continue;
        inverted.count();
        inverted.involve(std::int32_t(part.firstTriangle),
                         middleOf(cornersOf(tree.surface(), part.firstTriangle)));
    }
    inverted.appendTo(findings);
    if (!findings.empty()) return {};
    const std::vector<Vec3d> places = nest.placesInside(volumes, around, execution);
    for (std::size_t s = 0; s < places.size(); ++s) measured.shells[s].insideWorld = places[s];
    return measured;
}

/// How a fault is told: of one, of several, and in a list of others.
struct FaultWords {
    const char* name;
    const char* one;
    const char* several;
    const char* shortOne;
    const char* shortSeveral;
};
const FaultWords& wordsFor(SurfaceFault fault) {
    static constexpr std::array<FaultWords, 8> kWords{{
        {"degenerate", "triangle is degenerate, with zero area", "triangles are degenerate, with zero area",
         "triangle of zero area", "triangles of zero area"},
        {"duplicate", "triangle is there twice", "triangles are there twice", "duplicate triangle",
         "duplicate triangles"},
        {"non-manifold", "edge belongs to more than two triangles", "edges belong to more than two triangles",
         "edge of more than two triangles", "edges of more than two triangles"},
        {"open", "edge belongs to one triangle only, so the surface is open",
         "edges belong to one triangle only, so the surface is open", "open edge", "open edges"},
        {"turned", "triangle is turned: it runs the other way round than its neighbours",
         "triangles are turned: they run the other way round than their neighbours", "turned triangle",
         "turned triangles"},
        {"non-orientable", "part of the surface has only one side, as a Moebius strip has",
         "parts of the surface have only one side, as a Moebius strip has", "part with only one side",
         "parts with only one side"},
        {"crossing", "pair of triangles crosses or touches outside of common corners and edges",
         "pairs of triangles cross or touch outside of common corners and edges",
         "pair of triangles that crosses", "pairs of triangles that cross"},
        {"inverted", "part of the surface looks inwards (its triangles run clockwise, seen from outside)",
         "parts of the surface look inwards (their triangles run clockwise, seen from outside)",
         "part that looks inwards", "parts that look inwards"},
    }};
    return kWords[std::size_t(fault)];
}

/// Points that triangles use at exactly the place of another such point.
std::int64_t countCoincidentPoints(const Surface& surface) {
    const std::vector<std::int32_t> first = firstNodeAtPlace(surface.points, {});
    std::vector<std::uint8_t> used(surface.points.size(), 0), placeUsed(surface.points.size(), 0);
    for (const auto& triangle : surface.triangles)
        for (const std::int32_t point : triangle) used[std::size_t(point)] = 1;
    std::int64_t count = 0;
    for (std::size_t p = 0; p < used.size(); ++p) {
        if (!used[p]) continue;
        count += placeUsed[std::size_t(first[p])];
        placeUsed[std::size_t(first[p])] = 1;
    }
    return count;
}

/// Whether one of a finding's first triangles has two corners at one place.
bool namesCollapsed(const SurfaceFinding& finding, const Surface& surface) {
    return std::any_of(finding.triangles.begin(), finding.triangles.end(), [&](std::int64_t triangle) {
        const auto [a, b, c] = cornersOf(surface, triangle);
        return a == b || b == c || c == a;
    });
}

/// What repairSurface may do about the findings, to go behind a sentence.
std::string repairHint(const std::vector<SurfaceFinding>& findings, const Surface& surface) {
    bool mayBeUnmerged = false, removesOrTurns = false;
    for (const auto& finding : findings) {
        const SurfaceFault fault = finding.fault;
        if (fault == SurfaceFault::open || fault == SurfaceFault::nonManifold ||
            fault == SurfaceFault::crossing)
            mayBeUnmerged = true;
        if (fault == SurfaceFault::duplicate || fault == SurfaceFault::turned ||
            fault == SurfaceFault::inverted ||
            (fault == SurfaceFault::degenerate && namesCollapsed(finding, surface)))
            removesOrTurns = true;
    }
    const std::int64_t coincident = mayBeUnmerged ? countCoincidentPoints(surface) : 0;
    if (coincident > 0)
        return "; " + std::to_string(coincident) +
               (coincident == 1 ? " point lies at the same place as another"
                                : " points lie at the same place as others") +
               ": tessera-tetrahedralize --repair-surface merges them";
    return removesOrTurns ? "; tessera-tetrahedralize --repair-surface merges points and turns triangles"
                          : "";
}

std::string triangleNames(const std::vector<std::int64_t>& triangles) {
    std::string text = triangles.size() == 1 ? "triangle" : "triangles";
    for (std::size_t i = 0; i < std::min(triangles.size(), kSpokenTriangles); ++i)
        text += (i == 0 ? " " : ", ") + std::to_string(triangles[i]);
    if (triangles.size() > kSpokenTriangles) text += " and more";
    return text + " (counted from 0)";
}

}  // namespace

const char* nameOf(SurfaceFault fault) {
    return wordsFor(fault).name;
}

std::vector<SurfaceFinding> findSurfaceFaults(const Surface& surface, const Execution& execution,
                                              SurfaceShells* shells) {
    if (shells) *shells = {};
    std::vector<SurfaceFinding> findings;
    if (surface.triangles.empty()) return findings;
    // Faults of single triangles would show as faults of their edges too.
    std::vector<std::uint8_t> leftOut = flatTriangles(surface, execution);
    findMarked(SurfaceFault::degenerate, surface, leftOut, findings);
    const std::vector<std::uint8_t> duplicates = laterDuplicates(surface, leftOut);
    findMarked(SurfaceFault::duplicate, surface, duplicates, findings);
    for (std::size_t t = 0; t < leftOut.size(); ++t) leftOut[t] |= duplicates[t];
    execution.throwIfCancelled();

    const std::size_t single = findings.size();
    const std::vector<EdgeUse> uses = edgeUses(surface, leftOut);
    findEdgeFaults(surface, uses, findings);
    execution.throwIfCancelled();
    SurfaceParts found = findParts(surface, uses, leftOut);
    findTurned(surface, uses, found, findings);
    const TriangleTree tree(surface, leftOut, execution);
    findCrossingTriangles(tree, execution, findings);
    if (findings.size() > single) return findings;
    SurfaceShells measured = measureShells(tree, std::move(found), findings, execution);
    if (shells && findings.empty()) *shells = std::move(measured);
    return findings;
}

std::string faultSentence(const std::vector<SurfaceFinding>& findings, const Surface& surface) {
    if (findings.empty()) return "";
    const SurfaceFinding& first = findings.front();
    const FaultWords& words = wordsFor(first.fault);
    std::string text = std::to_string(first.count) + " " + (first.count == 1 ? words.one : words.several) +
                       (first.count == 1 ? ", near " : ", the first near ") + placeText(first.placeWorld) +
                       ": " + triangleNames(first.triangles);
    for (std::size_t i = 1; i < findings.size(); ++i) {
        const FaultWords& other = wordsFor(findings[i].fault);
        text += (i == 1                     ? "; also "
                 : i + 1 == findings.size() ? " and "
                                            : ", ") +
                std::to_string(findings[i].count) + " " +
                (findings[i].count == 1 ? other.shortOne : other.shortSeveral);
    }
    return text + repairHint(findings, surface);
}

}  // namespace tessera
