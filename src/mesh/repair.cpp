#include "mesh/repair.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <unordered_map>
#include <utility>

#include "base/parallel.h"
#include "mesh/element_merge.h"
#include "mesh/flat_elements.h"
#include "mesh/geometry.h"
#include "mesh/precise_volume.h"
#include "mesh/tet_complex.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::int64_t kRepairChunk = 1 << 14;
/// Times minAspect and the longest edge: how far the boundary may move in one operation.
constexpr double kDeviation = 4;
/// The same: how far apart parts are that are merged before an element at the boundary is taken away.
constexpr double kNear = 10;

/// What is tried, in this order, until one succeeds.
enum class Step { recipe, near, drop, dropFlat, any };
constexpr std::size_t kSteps = 5;

double longestEdge(const Corners& c) {
    double longest = 0;
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = i + 1; j < 4; ++j) longest = std::max(longest, glm::distance(c[i], c[j]));
    return longest;
}

/// Works on the degenerate elements of one mesh, all others positively oriented.
class Repairer {
  public:
    Repairer(TetMesh mesh, const RepairOptions& options, double maxLossWorld, RepairReport& report,
             const Execution& execution)
        : complex_(std::move(mesh)),
          judge_(complex_),
          options_(options),
          maxLoss_(maxLossWorld),
          report_(report),
          execution_(execution) {}

    void run(const std::vector<std::int32_t>& degenerate);
    TetMesh takeMesh() { return complex_.takeMesh(); }

  private:
    struct Trial {
        Trial() { at.fill(-1); }
        std::array<std::int32_t, kSteps> at;  ///< the operation count when the step last failed
        Refusal refusal = Refusal::shape;
    };

    Corners corners(std::int32_t element) const;
    bool isFlat(std::int32_t element) const;
    void prepareFlat(const std::vector<std::int32_t>& degenerate);
    void sortWorstFirst(std::vector<std::int32_t>& elements) const;
    bool passOver(std::vector<std::int32_t>& pending, std::size_t lastStep);
    bool attempt(std::int32_t element, Step step);
    bool tryMerges(std::int32_t element, const std::vector<Merge>& merges, double maxDistance);
    bool tryDrop(std::int32_t element);
    void drop(std::int32_t element);
    void apply(const Change& change, const Merge& merge, const Verdict& verdict);
    void moveBoundary(const std::vector<Tet>& before, const std::vector<Tet>& after, double distance);
    void touch(const Tet& tet);
    void refuse(std::int32_t element, Refusal refusal);
    void countKept(const std::vector<std::int32_t>& pending);

    TetComplex complex_;
    ChangeJudge judge_;
    const RepairOptions& options_;
    double maxLoss_;
    RepairReport& report_;
    const Execution& execution_;
    std::int32_t operations_ = 0;
    std::vector<std::int32_t> created_;                       ///< degenerate elements that operations made
    std::unordered_map<std::int32_t, Trial> trials_;          ///< by element
    std::unordered_map<std::int32_t, std::int32_t> touched_;  ///< by node: the last operation around it
    std::unordered_map<std::int32_t, double> moved_;  ///< by node: how far the boundary can have moved
};

Corners Repairer::corners(std::int32_t element) const {
    const Tet& t = complex_.tet(element);
    return {complex_.point(t[0]), complex_.point(t[1]), complex_.point(t[2]), complex_.point(t[3])};
}

bool Repairer::isFlat(std::int32_t element) const {
    const Corners c = corners(element);
    return volumeSign(c[0], c[1], c[2], c[3]) == 0;
}

/// Flat elements that nothing rests on go first: the others' faces tell then what they connect.
void Repairer::prepareFlat(const std::vector<std::int32_t>& degenerate) {
    std::vector<std::int32_t> flat;
    for (const std::int32_t e : degenerate)
        if (complex_.isAlive(e) && isFlat(e)) flat.push_back(e);
    for (bool progress = true; progress;) {
        progress = false;
        for (const std::int32_t e : flat) {
            if (!complex_.isAlive(e) || !isLooseFlatElement(complex_, e)) continue;
            complex_.removeElement(e);
            ++report_.droppedFlat;
            progress = true;
        }
        std::erase_if(flat, [&](std::int32_t e) { return !complex_.isAlive(e); });
    }
    orientFlatElements(complex_, flat);
}

void Repairer::sortWorstFirst(std::vector<std::int32_t>& elements) const {
    std::vector<std::pair<double, std::int32_t>> keyed;
    for (const std::int32_t e : elements) keyed.emplace_back(aspectOf(corners(e)), e);
    std::sort(keyed.begin(), keyed.end());
    for (std::size_t i = 0; i < keyed.size(); ++i) elements[i] = keyed[i].second;
}

void Repairer::run(const std::vector<std::int32_t>& degenerate) {
    report_.droppedFlat += complex_.repeatedNodeElements();
    prepareFlat(degenerate);
    std::vector<std::int32_t> pending;
    for (const std::int32_t e : degenerate)
        if (complex_.isAlive(e)) pending.push_back(e);
    for (std::size_t lastStep = 0; lastStep < kSteps; ++lastStep)
        while (passOver(pending, lastStep)) {
        }
    countKept(pending);
}

/// One try for every pending element, the worst first. Returns whether one succeeded.
bool Repairer::passOver(std::vector<std::int32_t>& pending, std::size_t lastStep) {
    sortWorstFirst(pending);
    bool progress = false;
    const auto total = std::int64_t(pending.size());
    for (std::int64_t i = 0; i < total; ++i) {
        const std::int32_t e = pending[std::size_t(i)];
        if (i % 64 == 0) {
            execution_.throwIfCancelled();
            execution_.report(Stage::repairing, i, total);
        }
        if (!complex_.isAlive(e)) continue;
        for (std::size_t step = 0; step <= lastStep; ++step) {
            if (!attempt(e, Step(step))) continue;
            progress = true;
            break;
        }
    }
    pending.insert(pending.end(), created_.begin(), created_.end());
    created_.clear();
    std::erase_if(pending, [&](std::int32_t e) { return !complex_.isAlive(e); });
    return progress;
}

bool Repairer::attempt(std::int32_t element, Step step) {
    std::int32_t lastTouched = 0;
    for (const std::int32_t node : complex_.tet(element)) {
        const auto found = touched_.find(node);
        if (found != touched_.end()) lastTouched = std::max(lastTouched, found->second);
    }
    std::int32_t& triedAt = trials_[element].at[std::size_t(step)];
    if (triedAt >= lastTouched) return false;
    triedAt = operations_;
    if (step == Step::drop) return tryDrop(element);
    const Corners c = corners(element);
    const Tet tet = complex_.tet(element);
    const double unit = options_.limits.minAspect * longestEdge(c);
    switch (step) {
        case Step::recipe:
            return tryMerges(element, recipeMerges(tet, c, thinShapeOf(c, options_.limits)),
                             std::numeric_limits<double>::infinity());
        case Step::near:
            return tryMerges(element, allMerges(tet, c), kNear * unit);
        case Step::any:
            return tryMerges(element, allMerges(tet, c), std::numeric_limits<double>::infinity());
        default:
            break;
    }
    if (!isFlat(element)) return false;
    ++report_.droppedFlat;
    ++report_.unmatchedFlat;
    drop(element);
    return true;
}

/// Takes the first pair of parts that works, in the place of least loss, then least deviation, then best
/// elements.
bool Repairer::tryMerges(std::int32_t element, const std::vector<Merge>& merges, double maxDistance) {
    const double longest = longestEdge(corners(element));
    const ChangeLimits limits{options_.limits.minAspect, kDeviation * options_.limits.minAspect * longest,
                              maxLoss_ - report_.volumeChangeWorld};
    const auto isBetter = [&](const Verdict& a, const Verdict& b) {
        const double roundingVolume = 1e-15 * report_.volumeBeforeWorld;
        if (std::max(a.lossWorld, b.lossWorld) > roundingVolume && a.lossWorld != b.lossWorld)
            return a.lossWorld < b.lossWorld;
        const double rounding = 1e-13 * longest;
        if (std::max(a.deviationWorld, b.deviationWorld) > rounding && a.deviationWorld != b.deviationWorld)
            return a.deviationWorld < b.deviationWorld;
        return a.worstAspect > b.worstAspect;
    };
    for (std::size_t begin = 0, end = 0; begin < merges.size(); begin = end) {
        const double distance = merges[begin].distanceWorld;
        if (distance > maxDistance) break;
        Verdict best;
        Change bestChange;
        std::size_t bestMerge = 0;
        for (end = begin; end < merges.size() && merges[end].distanceWorld == distance; ++end) {
            Change change = changeOf(complex_, merges[end]);
            const Verdict verdict = judge_.judge(change, limits);
            if (!verdict.allowed) {
                refuse(element, verdict.refusal);
            } else if (!best.allowed || isBetter(verdict, best)) {
                best = verdict;
                bestChange = std::move(change);
                bestMerge = end;
            }
        }
        if (!best.allowed) continue;
        apply(bestChange, merges[bestMerge], best);
        return true;
    }
    return false;
}

bool Repairer::tryDrop(std::int32_t element) {
    if (isFlat(element)) {
        if (!isLooseFlatElement(complex_, element)) return false;
        ++report_.droppedFlat;
        drop(element);
        return true;
    }
    const Tet& t = complex_.tet(element);
    const bool isAtBoundary =
        complex_.faceUsers({t[1], t[2], t[3]}) == 1 || complex_.faceUsers({t[0], t[2], t[3]}) == 1 ||
        complex_.faceUsers({t[0], t[1], t[3]}) == 1 || complex_.faceUsers({t[0], t[1], t[2]}) == 1;
    if (!isAtBoundary) return false;
    const Corners c = corners(element);
    const double volume = preciseVolume(c);
    if (!(volume <= maxLoss_ - report_.volumeChangeWorld)) {
        refuse(element, Refusal::volume);
        return false;
    }
    report_.volumeChangeWorld += volume;
    ++report_.dropped;
    moveBoundary({t}, {t}, aspectOf(c) * longestEdge(c));
    drop(element);
    return true;
}

void Repairer::drop(std::int32_t element) {
    ++operations_;
    touch(complex_.tet(element));
    complex_.removeElement(element);
}

void Repairer::apply(const Change& change, const Merge& merge, const Verdict& verdict) {
    ++operations_;
    const std::size_t parts = merge.first.count * merge.second.count;
    ++(parts == 1   ? report_.collapses
       : parts == 2 ? report_.edgeSplits
       : parts == 4 ? report_.edgePairSplits
                    : report_.faceSplits);
    if (change.hasNewNode) complex_.addNode(change.newNode);
    std::vector<Tet> before, after;
    for (const std::int32_t e : change.removed) {
        before.push_back(complex_.tet(e));
        touch(complex_.tet(e));
        complex_.removeElement(e);
    }
    for (const Change::Added& added : change.added) {
        const std::int32_t e = complex_.addElement(added.tet, added.parent);
        after.push_back(added.tet);
        touch(added.tet);
        if (!(aspectOf(corners(e)) >= options_.limits.minAspect)) created_.push_back(e);
    }
    report_.volumeChangeWorld += verdict.lossWorld;
    if (verdict.deviationWorld > 0) moveBoundary(before, after, verdict.deviationWorld);
}

void Repairer::moveBoundary(const std::vector<Tet>& before, const std::vector<Tet>& after, double distance) {
    double soFar = 0;
    for (const Tet& tet : before)
        for (const std::int32_t node : tet)
            if (const auto found = moved_.find(node); found != moved_.end())
                soFar = std::max(soFar, found->second);
    const double moved = soFar + distance;
    for (const Tet& tet : after)
        for (const std::int32_t node : tet) moved_[node] = std::max(moved_[node], moved);
    report_.boundaryDeviationWorld = std::max(report_.boundaryDeviationWorld, moved);
}

void Repairer::touch(const Tet& tet) {
    for (const std::int32_t node : tet) touched_[node] = operations_;
}

void Repairer::refuse(std::int32_t element, Refusal refusal) {
    ++report_.refused[std::size_t(refusal)];
    Refusal& kept = trials_[element].refusal;
    kept = std::max(kept, refusal);
}

void Repairer::countKept(const std::vector<std::int32_t>& pending) {
    for (const std::int32_t e : pending) {
        ++report_.kept[std::size_t(trials_[e].refusal)];
        report_.keptVolumeWorld += preciseVolume(corners(e));
    }
}

std::int64_t turnInverted(TetMesh& mesh, const Execution& execution) {
    const std::int64_t chunks = (mesh.elementCount() + kRepairChunk - 1) / kRepairChunk;
    std::vector<std::int64_t> parts(std::size_t(chunks), 0);
    parallelFor(execution, chunks, [&](std::int64_t chunk) {
        const std::int64_t end = std::min(mesh.elementCount(), (chunk + 1) * kRepairChunk);
        for (std::int64_t e = chunk * kRepairChunk; e < end; ++e) {
            const Corners c = cornersOf(mesh, e);
            if (volumeSign(c[0], c[1], c[2], c[3]) >= 0) continue;
            auto& tet = mesh.tets[std::size_t(e)];
            std::swap(tet[2], tet[3]);
            ++parts[std::size_t(chunk)];
        }
    });
    std::int64_t sum = 0;
    for (const std::int64_t part : parts) sum += part;
    return sum;
}

std::vector<RepairReport::FieldRange> rangesOf(const TetMesh& mesh) {
    std::vector<RepairReport::FieldRange> ranges;
    for (const Field& field : mesh.fields)
        for (int c = 0; c < field.components; ++c)
            ranges.push_back({field.name, c, fieldRange(field, c), {}});
    return ranges;
}

void checkOptions(const RepairOptions& options) {
    const auto check = [](const char* what, double value, double low, double high) {
        if (!(value >= low && value <= high))
            throw InputError(std::string("repair: expected ") + what + " from " + std::to_string(low) +
                             " to " + std::to_string(high) + ", got " + std::to_string(value));
    };
    check("a smallest aspect ratio", options.limits.minAspect, 1e-12, 0.5);
    check("a largest dihedral angle", options.limits.maxDihedralDegrees, 90, 179.999);
    check("a share of volume", options.maxVolumeLoss, 0, 1);
}

}  // namespace

double RepairReport::relativeVolumeChange() const {
    return volumeBeforeWorld > 0 ? std::fabs(volumeAfterWorld - volumeBeforeWorld) / volumeBeforeWorld : 0;
}

bool RepairReport::rangesGrew() const {
    return std::any_of(ranges.begin(), ranges.end(), [](const FieldRange& r) {
        return !r.after.empty() && (r.after.min < r.before.min || r.after.max > r.before.max);
    });
}

TetMesh repair(TetMesh mesh, const RepairOptions& options, RepairReport& report, const Execution& execution) {
    checkOptions(options);
    report = {};
    report.elementsBefore = mesh.elementCount();
    report.nodesBefore = mesh.nodeCount();
    report.volumeBeforeWorld = totalVolume(mesh, execution);
    std::vector<std::int32_t> degenerate;
    report.before = countClasses(mesh, options.limits, execution, &degenerate);
    report.inverted = turnInverted(mesh, execution);
    if (!degenerate.empty()) {
        report.ranges = rangesOf(mesh);
        // A bound of everything is none: rounding must not keep the last element.
        const double maxLossWorld = options.maxVolumeLoss < 1
                                        ? options.maxVolumeLoss * report.volumeBeforeWorld
                                        : std::numeric_limits<double>::infinity();
        Repairer repairer(std::move(mesh), options, maxLossWorld, report, execution);
        repairer.run(degenerate);
        mesh = repairer.takeMesh();
        std::size_t r = 0;
        for (const RepairReport::FieldRange& range : rangesOf(mesh)) report.ranges[r++].after = range.before;
        report.volumeAfterWorld = totalVolume(mesh, execution);
        report.after = countClasses(mesh, options.limits, execution);
    } else {
        report.volumeAfterWorld = report.volumeBeforeWorld;
        report.after = report.before;
    }
    report.elementsAfter = mesh.elementCount();
    report.nodesAfter = mesh.nodeCount();
    return mesh;
}

}  // namespace tessera
