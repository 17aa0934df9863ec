#include "refine/wish_plan.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <span>
#include <string>
#include <utility>

#include "refine/wishes.h"
#include "tessera/error.h"

namespace tessera {

namespace {

// What sampling costs, in nanoseconds of the software resampler: the elements near a brick are scanned once
// for the children on each side, and a call has work of its own. bench/brick_cost measures them.
constexpr double kCostElement = 450;
constexpr double kCostPoint = 8;
constexpr double kCostSplit = 50'000;
// Bricks that hold a focus come before what lies around it.
constexpr double kFocusGain = 64;

// A brick of which little is seen still counts for so much.
constexpr double kLeastSeen = 0.05;
// Splits by errors until new findings are waited for.
constexpr int kSplitsInRound = 32;

struct LimitReached {};

}  // namespace

WishPlan::WishPlan(MeshBricks& bricks, Wishes wishes, const PlanLimit& limit)
    : bricks_(bricks), wishes_(std::move(wishes)), limit_(limit), tree_(bricks.roots()) {
    checkFocus(wishes_.focus);
    const std::size_t roots = bricks.roots().size();
    if (roots > limit.bricks)
        throw InputError("the coarsest plan has " + std::to_string(roots) + " bricks, more than the " +
                         std::to_string(limit.bricks) + " allowed");
    numberOfSlot_.resize(roots);
    std::iota(numberOfSlot_.begin(), numberOfSlot_.end(), MeshBricks::Number(0));
    for (const MeshBricks::Number root : numberOfSlot_) consider(root);
}

double WishPlan::wishedSpacing(MeshBricks::Number brick) const {
    return isSeen(brick) ? std::min(wishedWithoutErrors(brick), wishedByError(brick)) : kNoWish;
}

double WishPlan::wishedWithoutErrors(MeshBricks::Number brick) const {
    return std::min(bricks_.wishedByElementSize(brick),
                    wishedByFocus(wishes_.focus, wishes_.finestSpacingWorld, bricks_.boxWorld(brick)));
}

// Trilinear errors fall with the square of the spacing.
double WishPlan::wishedByError(MeshBricks::Number brick) const {
    const BrickFindings* findings = wishes_.byError ? bricks_.findings(brick) : nullptr;
    if (!findings) return kNoWish;
    const double ratio = wishes_.visible ? wishes_.visible->visibleError(findings->bins) /
                                               wishes_.inspector->watchedBoundBins()
                                         : double(findings->worst);
    return ratio > 1 ? bricks_.spacingWorld(brick) / std::sqrt(ratio) : kNoWish;
}

bool WishPlan::isSeen(MeshBricks::Number brick) const {
    return !wishes_.visible || wishes_.visible->showsAny(bricks_.values(brick, *wishes_.inspector));
}

double WishPlan::costOfSplit(MeshBricks::Number brick) const {
    const int cells = bricks_.frame().brickCells;
    const double points = double(cells) * cells * cells * std::popcount(bricks_.children(brick));
    return kCostSplit + kCostPoint * points + kCostElement * double(bricks_.elementsNear(brick));
}

double WishPlan::valueOfSplit(MeshBricks::Number brick) const {
    if (!isSeen(brick)) return 0;
    const double spacing = bricks_.spacingWorld(brick);
    const double wished = wishedWithoutErrors(brick);
    if (!isTooCoarse(spacing, wished)) return valueOfError(brick);
    const double gain = holdsFocus(wishes_.focus, bricks_.boxWorld(brick)) ? kFocusGain : 1;
    return gain * (1 + benefitOfSplit(spacing, wished)) / costOfSplit(brick);
}

// Less than what any other criterion gives, and more the more of the brick is seen.
double WishPlan::valueOfError(MeshBricks::Number brick) const {
    const double spacing = bricks_.spacingWorld(brick), wished = wishedByError(brick);
    if (!isTooCoarse(spacing, wished)) return 0;
    double seen = 1;
    if (wishes_.visible) {
        const BrickFindings& findings = *bricks_.findings(brick);
        const double most = wishes_.visible->visibleError(findings.bins);
        seen = kLeastSeen + (1 - kLeastSeen) * wishes_.visible->meanVisibleError(findings.bins) / most;
    }
    const double benefit = benefitOfSplit(spacing, wished);
    return seen * benefit / (1 + benefit) / costOfSplit(brick);
}

void WishPlan::consider(MeshBricks::Number brick) {
    const DepthKey& key = bricks_.key(brick);
    if (key.depth >= bricks_.frame().maxDepth || !isSeen(brick)) return;
    const double wished = wishedWithoutErrors(brick);
    if (isTooCoarse(bricks_.spacingWorld(brick), wished)) {
        candidates_.push_back({valueOfSplit(brick), brick, key});
        std::push_heap(candidates_.begin(), candidates_.end());
    } else if (wishes_.byError) {
        unjudged_.push_back(brick);
    }
}

// Begins a round. False when it must wait.
bool WishPlan::considerErrors() {
    waitsFor_.clear();
    // Balance may have split some since.
    std::erase_if(unjudged_, [&](MeshBricks::Number brick) { return !tree_.findLeaf(bricks_.key(brick)); });
    for (const MeshBricks::Number brick : unjudged_)
        if (!bricks_.findings(brick)) waitsFor_.push_back(brick);
    if (!waitsFor_.empty()) return false;
    for (const MeshBricks::Number brick : unjudged_) {
        const double value = valueOfError(brick);
        if (value == 0) continue;
        byError_.push_back({value, brick, bricks_.key(brick)});
        std::push_heap(byError_.begin(), byError_.end());
    }
    unjudged_.clear();
    leftInRound_ = kSplitsInRound;
    return true;
}

// The best leaf to split; none when the plan is complete or waits.
std::optional<WishPlan::Candidate> WishPlan::popCandidate() {
    while (true) {
        std::vector<Candidate>* from = &candidates_;
        if (candidates_.empty()) {
            if (!wishes_.byError) return {};
            const bool isNewRound = leftInRound_ == 0 || byError_.empty();
            if (isNewRound && (!considerErrors() || byError_.empty())) return {};
            --leftInRound_;
            from = &byError_;
        }
        std::pop_heap(from->begin(), from->end());
        const Candidate candidate = from->back();
        from->pop_back();
        // Balance may have split it before its turn.
        if (tree_.findLeaf(candidate.key)) return candidate;
    }
}

// False, and the plan is as it was, when the limit doesn't allow it.
bool WishPlan::split(const DepthKey& key) {
    const TreeChange& change = tree_.change();
    std::vector<ChildBits> children;  // of change.removed
    const auto choose = [&](std::span<const GrowingLeaf> wave, std::span<ChildBits> bits) {
        std::size_t added = 0;
        for (std::size_t i = 0; i < wave.size(); ++i) {
            bits[i] = bricks_.children(numberOfSlot_[wave[i].slot]);
            added += std::size_t(std::popcount(bits[i]));
        }
        // The bricks that were split are leaves no more, but are there.
        const std::size_t split = splitCount_ + change.removed.size() + wave.size();
        const std::size_t leaves = tree_.leafCount() + added - wave.size();
        if (leaves + (limit_.counts == PlanLimit::Counts::all ? split : 0) > limit_.bricks)
            throw LimitReached{};
        children.insert(children.end(), bits.begin(), bits.end());
    };
    try {
        tree_.split(key, choose);
    } catch (const LimitReached&) {
        return false;
    }
    splitCount_ += change.removed.size();
    std::vector<MeshBricks::Number> added;
    for (std::size_t i = 0; i < change.removed.size(); ++i) {
        const MeshBricks::Number brick = numberOfSlot_[change.removed[i].slot];
        made_.push_back({brick, children[i]});
        for (unsigned bits = children[i]; bits != 0; bits &= bits - 1)
            added.push_back(bricks_.child(brick, unsigned(std::countr_zero(bits))));
    }
    numberOfSlot_.resize(tree_.slotCount());
    for (std::size_t i = 0; i < added.size(); ++i) numberOfSlot_[change.added[i].slot] = added[i];
    for (const MeshBricks::Number brick : added) consider(brick);
    // The coarsest last, to be given out first.
    std::stable_sort(made_.begin(), made_.end(), [&](const Split& a, const Split& b) {
        return bricks_.key(a.brick).depth > bricks_.key(b.brick).depth;
    });
    return true;
}

std::optional<WishPlan::Split> WishPlan::next() {
    while (made_.empty()) {
        if (isCutShort_) return {};
        const std::optional<Candidate> best = popCandidate();
        if (!best) return {};
        isCutShort_ = !split(best->key);
        if (isCutShort_) waitsFor_.clear();
    }
    const Split split = made_.back();
    made_.pop_back();
    return split;
}

void WishPlan::complete(const Execution& execution) {
    while (next()) execution.throwIfCancelled();
}

}  // namespace tessera
