#include "refine/wish_plan.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "refine/wishes.h"
#include "tessera/error.h"

namespace tessera {

namespace {

// What sampling costs, in nanoseconds of the software resampler: the elements near a brick are scanned once
// for the children on each side, and a call has work of its own. `tessera bench` measures the like.
constexpr double kCostElement = 450;
constexpr double kCostPoint = 8;
constexpr double kCostSplit = 50'000;
// Of very small elements no more than so many are near a point.
constexpr double kElementsAPoint = 8;
// Bricks that hold a focus come before what lies around it.
constexpr double kFocusGain = 64;

// A brick of which little is seen still counts for so much.
constexpr double kLeastSeen = 0.05;
// Splits by errors until new findings are waited for.
constexpr int kSplitsInRound = 32;

// A split wished for by `wished`, in a brick that holds a focus or not.
double valueOf(double spacing, double wished, bool holdsFocus, double cost) {
    return (holdsFocus ? kFocusGain : 1) * (1 + benefitOfSplit(spacing, wished)) / cost;
}

}  // namespace

WishPlan::WishPlan(MeshBricks& bricks, Wishes wishes, const PlanLimit& limit)
    : bricks_(bricks), wishes_(std::move(wishes)), limit_(limit), leafCount_(bricks.roots().size()) {
    checkFocus(wishes_.focus);
    if (leafCount_ > limit.bricks)
        throw InputError("the coarsest plan has " + std::to_string(leafCount_) + " bricks, more than the " +
                         std::to_string(limit.bricks) + " allowed");
    states_.assign(bricks.count(), State::absent);
    std::fill_n(states_.begin(), leafCount_, State::leaf);
    if (bricks.frame().maxDepth == Depth(0)) return;
    for (MeshBricks::Number root = 0; root < leafCount_; ++root)
        consider(root, bricks.frame().rootSpacingWorld,
                 wishedByFocus(wishes_.focus, wishes_.finestSpacingWorld, bricks_.boxWorld(root)),
                 holdsFocus(wishes_.focus, bricks_.boxWorld(root)));
}

double WishPlan::wishedSpacing(MeshBricks::Number brick) const {
    return isSeen(brick) ? std::min(wishedWithoutErrors(brick), wishedByError(brick)) : kNoWish;
}

double WishPlan::wishedWithoutErrors(MeshBricks::Number brick) const {
    return wishedWithoutErrors(
        brick, wishedByFocus(wishes_.focus, wishes_.finestSpacingWorld, bricks_.boxWorld(brick)));
}

double WishPlan::wishedWithoutErrors(MeshBricks::Number brick, double byFocus) const {
    return std::min(std::numbers::sqrt2 * byFocus, bricks_.wishedByElementSize(brick));
}

double WishPlan::errorOverBound(MeshBricks::Number brick) const {
    const BrickFindings* findings = bricks_.findings(brick);
    if (!findings || !isSeen(brick)) return 0;
    return wishes_.visible
               ? wishes_.visible->visibleError(findings->bins) / wishes_.inspector->watchedBoundBins()
               : double(findings->worst);
}

// Trilinear errors fall with the square of the spacing.
double WishPlan::wishedByError(MeshBricks::Number brick) const {
    const double ratio = wishes_.byError ? errorOverBound(brick) : 0;
    return ratio > 1 ? bricks_.spacingWorld(brick) / std::sqrt(ratio) : kNoWish;
}

bool WishPlan::isSeen(MeshBricks::Number brick) const {
    return !wishes_.visible || wishes_.visible->showsAny(bricks_.values(brick, *wishes_.inspector));
}

double WishPlan::costOfSplit(MeshBricks::Number brick) const {
    const int cells = bricks_.frame().brickCells;
    const double points = double(cells) * cells * cells * std::popcount(bricks_.children(brick));
    const double elements = std::min(double(bricks_.elementsNear(brick)), kElementsAPoint * points);
    return kCostSplit + kCostPoint * points + kCostElement * elements;
}

double WishPlan::valueOfSplit(MeshBricks::Number brick) const {
    if (!isSeen(brick)) return 0;
    const double spacing = bricks_.spacingWorld(brick);
    const double wished = wishedWithoutErrors(brick);
    if (!isTooCoarse(spacing, wished)) return valueOfError(brick);
    return valueOf(spacing, wished, holdsFocus(wishes_.focus, bricks_.boxWorld(brick)), costOfSplit(brick));
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

// Most bricks are fine enough: nothing of theirs is read then, as reading from memory is what plans cost.
void WishPlan::consider(MeshBricks::Number brick, double spacingWorld, double byFocus, bool holdsFocus) {
    if (!isSeen(brick)) return;
    const double wished = wishedWithoutErrors(brick, byFocus);
    if (isTooCoarse(spacingWorld, wished))
        candidates_.push(valueOf(spacingWorld, wished, holdsFocus, costOfSplit(brick)), brick);
    else if (wishes_.byError)
        unjudged_.push_back(brick);
}

// Begins a round. False when it must wait.
bool WishPlan::considerErrors() {
    waitsFor_.clear();
    // Balance may have split some since.
    std::erase_if(unjudged_, [&](MeshBricks::Number brick) { return isSplit(brick); });
    for (const MeshBricks::Number brick : unjudged_)
        if (!bricks_.findings(brick)) waitsFor_.push_back(brick);
    if (!waitsFor_.empty()) return false;
    for (const MeshBricks::Number brick : unjudged_)
        if (const double value = valueOfError(brick); value > 0) byError_.push(value, brick);
    unjudged_.clear();
    leftInRound_ = kSplitsInRound;
    return true;
}

// The best leaf to split; none when the plan is complete or waits.
std::optional<MeshBricks::Number> WishPlan::popCandidate() {
    while (true) {
        SplitQueue* from = &candidates_;
        if (candidates_.empty()) {
            if (!wishes_.byError) return {};
            const bool isNewRound = leftInRound_ == 0 || byError_.empty();
            if (isNewRound && (!considerErrors() || byError_.empty())) return {};
            --leftInRound_;
            from = &byError_;
        }
        const MeshBricks::Number brick = *from->pop();
        // Balance may have split it before its turn.
        if (!isSplit(brick)) return brick;
    }
}

// Splits a leaf, and before it the coarser leaves that touch it.
void WishPlan::require(MeshBricks::Number brick) {
    for (const MeshBricks::Number near : bricks_.nearParents(brick))
        if (stateOf(near) == State::leaf) require(near);
    made_.push_back({brick, bricks_.children(brick)});
    states_[brick] = State::split;
}

// False, and the plan is as it was, when the limit doesn't allow it.
bool WishPlan::split(MeshBricks::Number brick) {
    made_.clear();
    given_ = 0;
    require(brick);
    std::size_t leaves = leafCount_ - made_.size();
    for (const Split& split : made_) leaves += std::size_t(std::popcount(split.children));
    // The bricks that were split are leaves no more, but are there.
    const std::size_t above = limit_.counts == PlanLimit::Counts::all ? splitCount_ + made_.size() : 0;
    if (leaves + above > limit_.bricks) {
        for (const Split& split : made_) states_[split.brick] = State::leaf;
        made_.clear();
        return false;
    }
    leafCount_ = leaves;
    splitCount_ += made_.size();
    if (states_.size() < bricks_.count()) states_.resize(bricks_.count(), State::absent);
    for (const Split& split : made_)
        for (unsigned bits = split.children; bits != 0; bits &= bits - 1)
            states_[bricks_.child(split.brick, unsigned(std::countr_zero(bits)))] = State::leaf;
    for (const Split& split : made_) {
        // The finest bricks wish for nothing.
        if (bricks_.key(split.brick).depth + 1 >= bricks_.frame().maxDepth) continue;
        const double spacing = bricks_.spacingWorld(split.brick) / 2;
        const ChildWishes wishes =
            wishesOfChildren(wishes_.focus, wishes_.finestSpacingWorld, bricks_.childBoxesWorld(split.brick),
                             spacing / std::numbers::sqrt2);
        for (unsigned bits = split.children; bits != 0; bits &= bits - 1) {
            const auto c = unsigned(std::countr_zero(bits));
            consider(bricks_.child(split.brick, c), spacing, wishes.wishedWorld[c], wishes.holdsFocus[c]);
        }
    }
    return true;
}

std::optional<WishPlan::Split> WishPlan::next() {
    while (given_ == made_.size()) {
        if (isCutShort_) return {};
        const std::optional<MeshBricks::Number> best = popCandidate();
        if (!best) return {};
        isCutShort_ = !split(*best);
        if (isCutShort_) waitsFor_.clear();
    }
    return made_[given_++];
}

void WishPlan::complete(const Execution& execution) {
    while (next()) execution.throwIfCancelled();
}

std::vector<MeshBricks::Number> WishPlan::leaves() const {
    std::vector<MeshBricks::Number> leaves;
    leaves.reserve(leafCount_);
    for (MeshBricks::Number brick = 0; brick < states_.size(); ++brick)
        if (states_[brick] == State::leaf) leaves.push_back(brick);
    std::sort(leaves.begin(), leaves.end(), [&](MeshBricks::Number a, MeshBricks::Number b) {
        return inStorageOrder(bricks_.key(a), bricks_.key(b));
    });
    return leaves;
}

Depth WishPlan::deepest() const {
    Depth deepest;
    for (MeshBricks::Number brick = 0; brick < states_.size(); ++brick)
        if (states_[brick] == State::leaf) deepest = std::max(deepest, bricks_.key(brick).depth);
    return deepest;
}

BrickTree WishPlan::brickTree(Depth finest) const {
    std::vector<BrickKey> keys;
    keys.reserve(leafCount_);
    for (MeshBricks::Number brick = 0; brick < states_.size(); ++brick)
        if (states_[brick] == State::leaf)
            keys.push_back({levelOf(bricks_.key(brick).depth, finest), bricks_.key(brick).index});
    const PlanFrame& frame = bricks_.frame();
    return BrickTree(frame.originWorld, std::ldexp(frame.rootSpacingWorld, -finest.halvings()),
                     frame.brickCells, std::move(keys));
}

}  // namespace tessera
