#include "schedule/brick_scheduler.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <utility>

#include "base/check.h"
#include "refine/plan_frame.h"
#include "refine/wishes.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Bricks of the largest single change: so much of the budget isn't planned for, or nothing could be sampled
/// beside what is shown.
constexpr std::size_t kLargestChange = 8;

PlanFrame frameOf(const TetMesh& mesh, const ScheduleOptions& options, const ElementIndex* index,
                  const Execution& execution) {
    const RefineOptions& refine = options.refine;
    const Box3d box = meshBounds(mesh, execution, index);
    RefineOptions withFocus = refine;
    if (withFocus.focus.empty()) withFocus.focus.push_back(pointFocus(box.min, 1));
    checkOptions(mesh, box, withFocus);
    if (refine.criterion.has(Criterion::uniform))
        throw InputError("a scheduler refines by element size, error or a focus, not to one spacing");
    return chooseFrame(box, refine);
}

int channelsOf(const TetMesh& mesh, std::span<const int> fields) {
    int channels = 0;
    for (const int f : fields) channels += mesh.fields.at(std::size_t(f)).components;
    return channels;
}

BindOptions bindOptions(const ScheduleOptions& options, std::shared_ptr<const SharedElementIndex> index,
                        Route route) {
    BindOptions bind = options.refine.bind;
    bind.route = route;
    bind.index = std::move(index);
    return bind;
}

std::shared_ptr<const SharedElementIndex> indexOf(const TetMesh& mesh, const ScheduleOptions& options) {
    if (options.refine.bind.index) return options.refine.bind.index;
    return std::make_shared<const SharedElementIndex>(mesh);
}

// The channel whose values are looked at: that of a field's first component, by its name.
int channelOf(const TetMesh& mesh, std::span<const int> fields, const std::string& name) {
    int channel = 0;
    for (const int f : fields) {
        const Field& field = mesh.fields.at(std::size_t(f));
        if (name.empty() || field.name == name) return channel;
        channel += field.components;
    }
    throw InputError("the transfer function is for field " + name + ", which isn't among those sampled");
}

Wishes firstWishes(const TetMesh& mesh, std::span<const int> fields, const ScheduleOptions& options,
                   const Box3d& meshBoundsWorld, std::shared_ptr<const SharedElementIndex> index,
                   const Execution& execution) {
    const RefineOptions& refine = options.refine;
    Wishes wishes{.focus = refine.focus,
                  .finestSpacingWorld = focusSpacing(meshBoundsWorld, refine),
                  .byError = refine.criterion.has(Criterion::error)};
    if (!refine.criterion.has(Criterion::focus)) wishes.focus.clear();
    if (!wishes.byError && !options.transferFunction) return wishes;
    const std::string name = options.transferFunction ? options.transferFunction->field : "";
    wishes.inspector = std::make_shared<const BrickInspector>(std::move(index), fields, refine,
                                                              channelOf(mesh, fields, name), execution);
    if (wishes.byError && options.transferFunction && wishes.inspector->watchedRange().width() > 0 &&
        std::isinf(wishes.inspector->watchedBound()))
        throw InputError("the error bound doesn't hold for " +
                         (name.empty() ? "the field" : "field " + name) +
                         " that the transfer function is for");
    if (options.transferFunction)
        wishes.visible = std::make_shared<const VisibleValues>(*options.transferFunction,
                                                               wishes.inspector->watchedRange());
    return wishes;
}

}  // namespace

std::int64_t bytesOfBrick(int channels, int brickCells) {
    const std::int64_t edge = brickCells + 1;
    return edge * edge * edge * (std::int64_t(sizeof(float)) * channels + 1);
}

BrickScheduler::BrickScheduler(const TetMesh& mesh, std::span<const int> fields, const Resampler& resampler,
                               const ScheduleOptions& options, BrickTarget& target,
                               const Execution& execution)
    : index_(indexOf(mesh, options)),
      bound_(resampler.bind(mesh, fields, bindOptions(options, index_, Route::index))),
      bricks_(index_, frameOf(mesh, options, index_->ifBuilt(), execution),
              options.refine.criterion.has(Criterion::elementSize) ? options.refine.samplesPerElement : 0,
              execution),
      target_(target),
      brickBytes_(bytesOfBrick(channelsOf(mesh, fields), options.refine.brickCells)),
      budgetBytes_(options.budgetBytes),
      watchedField_(options.transferFunction ? options.transferFunction->field : ""),
      wishes_(firstWishes(mesh, fields, options, bricks_.frame().meshBoundsWorld, index_, execution)),
      sampling_(*bound_, index_, bricks_.frame(), wishes_.byError ? wishes_.inspector : nullptr,
                options.archive, options.threads) {
    if (!wishes_.inspector && !options.archive)
        passing_ = resampler.bind(mesh, fields, bindOptions(options, index_, Route::pass));
    replan();
}

BrickScheduler::~BrickScheduler() = default;

std::int64_t BrickScheduler::leastBudgetBytes() const {
    return std::int64_t(bricks_.roots().size() + kLargestChange) * brickBytes_;
}

PlanLimit BrickScheduler::limit() const {
    if (budgetBytes_ < leastBudgetBytes())
        throw InputError("a budget of " + std::to_string(budgetBytes_) +
                         " bytes is too small: the coarsest bricks and one change take " +
                         std::to_string(leastBudgetBytes()));
    return {PlanLimit::Counts::all, budgetBricks() - kLargestChange};
}

bool BrickScheduler::setFocus(std::vector<Focus> focus) {
    checkFocus(focus);
    if (isJitter(wishes_.focus, focus, wishes_.finestSpacingWorld)) return false;
    wishes_.focus = std::move(focus);
    replan();
    return true;
}

void BrickScheduler::setTransferFunction(const std::optional<TransferFunction>& function) {
    if (!function) {
        wishes_.visible = nullptr;
    } else {
        if (!wishes_.inspector)
            throw InputError(
                "this scheduler doesn't look at values: give a transfer function or an error "
                "bound when it is made");
        if (function->field != watchedField_)
            throw InputError("the transfer function is for field " + function->field + ", not " +
                             watchedField_);
        wishes_.visible = std::make_shared<const VisibleValues>(*function, wishes_.inspector->watchedRange());
    }
    replan();
}

void BrickScheduler::setFindings(std::span<LeafFindings> findings) {
    for (LeafFindings& found : findings)
        bricks_.setFindings(*bricks_.find(found.leaf), std::move(found.findings));
    replan();
}

void BrickScheduler::setBudget(std::int64_t budgetBytes) {
    const std::int64_t before = std::exchange(budgetBytes_, budgetBytes);
    try {
        replan();
    } catch (...) {
        budgetBytes_ = before;
        throw;
    }
    while (!makeRoom(0)) {
        // What is being sampled takes the room.
        TESSERA_CHECK(!changes_.empty() && changes_.back().split, "a budget holds less than was planned");
        abandon(changes_.back());
        changes_.pop_back();
    }
}

void BrickScheduler::replan() {
    limit();  // throws before anything has changed
    plan_.reset();
    // Making a plan may build the index, which the coarsest bricks don't need.
    if (index_->ifBuilt()) plan();
    next_.reset();
    hasRanked_ = isAtRest_ = false;
    ++planNumber_;
    // Orders are begun one after the other, so those that wait are the last.
    while (!changes_.empty() && changes_.back().split && !sampling_.hasBegun(*changes_.back().order)) {
        abandon(changes_.back());
        changes_.pop_back();
    }
}

WishPlan& BrickScheduler::plan() {
    if (!plan_) plan_ = std::make_unique<WishPlan>(bricks_, wishes_, limit());
    return *plan_;
}

void BrickScheduler::abandon(const Change& change) {
    if (change.order) {
        sampling_.drop(*change.order);
        reserved_ -= change.missing;
    }
    for (const MeshBricks::Number brick : change.bricks)
        if (memory_.contains(brick)) memory_.release(brick);
}

void BrickScheduler::beginRoots() {
    Change roots;
    std::vector<std::vector<DepthKey>> each;
    for (const Vec3i& root : bricks_.roots()) {
        roots.bricks.push_back(MeshBricks::Number(roots.bricks.size()));
        each.push_back({{Depth(0), root}});
    }
    roots.missing = each.size();
    reserved_ += each.size();
    roots.order = sampling_.order(each);
    changes_.push_back(std::move(roots));
}

// False when there is no room.
bool BrickScheduler::beginChange(const WishPlan::Split& split) {
    Change change;
    change.split = split.brick;
    change.planNumber = planNumber_;
    change.children = split.children;
    // Two orders that wait for one brick would sample it twice.
    std::vector<std::vector<DepthKey>> halves(2);
    for (unsigned bits = split.children; bits != 0; bits &= bits - 1) {
        const MeshBricks::Number child = bricks_.child(split.brick, unsigned(std::countr_zero(bits)));
        change.bricks.push_back(child);
        const DepthKey& key = bricks_.key(child);
        if (!memory_.contains(child)) halves[std::size_t(key.index.z & 1)].push_back(key);
    }
    const std::size_t missing = halves[0].size() + halves[1].size();
    // What is there already must stay while room is made.
    for (const MeshBricks::Number child : change.bricks)
        if (memory_.contains(child)) memory_.hold(child);
    change.missing = missing;
    if (!makeRoom(missing)) {
        change.missing = 0;
        abandon(change);
        return false;
    }
    counts_.reused += std::int64_t(change.bricks.size() - missing);
    reserved_ += missing;
    change.order = sampling_.order(halves);
    changes_.push_back(std::move(change));
    return true;
}

// Takes changes from the plan until there are enough to keep all threads at work. False when the plan has no
// more.
bool BrickScheduler::fillQueue(Clock::time_point deadline) {
    constexpr std::size_t kAtOnce = 8;
    while (changes_.size() < kAtOnce && hasRoots_) {
        if (!next_) next_ = plan().next();
        if (!next_) return !plan().waitsFor().empty();
        // An older plan's change will be shown, or prove to have lost what it stands on: then it is begun
        // anew.
        if (std::any_of(changes_.begin(), changes_.end(),
                        [&](const Change& change) { return change.split == next_->brick; }))
            return true;
        if (!isSplit(next_->brick) && !beginChange(*next_)) return true;
        next_.reset();
        if (Clock::now() >= deadline) return true;
    }
    return true;
}

bool BrickScheduler::publishFinished() {
    bool any = false;
    while (!changes_.empty() && sampling_.isDone(*changes_.front().order)) {
        Change change = std::move(changes_.front());
        changes_.pop_front();
        for (SampledBrick& brick : sampling_.take(*change.order)) {
            const MeshBricks::Number number = numberOf(change.split, brick.key);
            memory_.add(number, std::move(brick.samples));
            if (brick.findings) bricks_.setFindings(number, std::move(*brick.findings));
            ++(brick.wasRead ? counts_.read : counts_.sampled);
        }
        reserved_ -= change.missing;
        show(change);
        any = true;
    }
    return any;
}

void BrickScheduler::show(const Change& change) {
    if (change.split) {
        // An older plan's change may have lost what it stands on.
        if (showSplit(change)) return;
        TESSERA_CHECK(change.planNumber < planNumber_, "a plan's change can't be shown");
        for (const MeshBricks::Number brick : change.bricks) memory_.release(brick);
        return;
    }
    tree_ = GrowingTree(bricks_.roots());
    hasRoots_ = true;
    const std::vector<GrowingLeaf> leaves = tree_.leaves();
    publish({}, {}, leaves);
}

bool BrickScheduler::showSplit(const Change& change) {
    struct Unbalanced {};
    const DepthKey& key = bricks_.key(*change.split);
    if (!tree_.findLeaf(key)) return false;
    bool isFirst = true;
    try {
        tree_.split(key, [&](std::span<const GrowingLeaf>, std::span<ChildBits> children) {
            if (!std::exchange(isFirst, false)) throw Unbalanced{};
            children[0] = change.children;
        });
    } catch (const Unbalanced&) {
        return false;
    }
    setSplit(*change.split, true);
    publish(change.split, tree_.change().removed, tree_.change().added);
    return true;
}

// Tells the target what the tree has changed within a brick; without one, all is new.
void BrickScheduler::publish(std::optional<MeshBricks::Number> within, std::span<const GrowingLeaf> removed,
                             std::span<const GrowingLeaf> added) {
    std::vector<ShownBrick> shown;
    for (const GrowingLeaf& leaf : added) shown.push_back({leaf, memory_.find(numberOf(within, leaf.key))});
    ++counts_.published;
    target_.publish({removed, shown, &tree_, within ? &bricks_.key(*within) : nullptr});
}

// Of a brick, or of one of its children; without one, of any that was looked at.
MeshBricks::Number BrickScheduler::numberOf(std::optional<MeshBricks::Number> within,
                                            const DepthKey& key) const {
    if (!within) return *bricks_.find(key);
    return key == bricks_.key(*within) ? *within : bricks_.child(*within, childNumber(key.index));
}

// Drops bricks until there is room for so many more.
bool BrickScheduler::makeRoom(std::size_t bricks) {
    while (memory_.brickCount() + reserved_ + bricks > budgetBricks()) {
        if (memory_.dropOldest())
            ++counts_.dropped;
        else if (!mergeLeastUseful())
            return false;
    }
    return true;
}

// Merges a brick that the plan doesn't split, or not yet. False when there is none.
bool BrickScheduler::mergeLeastUseful() {
    for (int attempt = 0; attempt < 2; ++attempt) {
        if (!hasRanked_) {
            std::vector<std::pair<double, MeshBricks::Number>> ranked;
            for (MeshBricks::Number brick = 0; brick < isSplit_.size(); ++brick)
                if (isSplit_[brick] && !plan().isSplit(brick))
                    ranked.emplace_back(plan().valueOfSplit(brick), brick);
            std::sort(ranked.begin(), ranked.end(), [&](const auto& a, const auto& b) {
                return a.first != b.first ? a.first > b.first
                                          : inStorageOrder(bricks_.key(a.second), bricks_.key(b.second));
            });
            leastUseful_.clear();
            for (const auto& [value, brick] : ranked) leastUseful_.push_back(brick);
            hasRanked_ = true;
            attempt = 1;  // nothing new to rank afterwards
        }
        for (std::size_t i = leastUseful_.size(); i-- > 0;) {
            const MeshBricks::Number brick = leastUseful_[i];
            if (plan().isSplit(brick) || !merge(brick)) continue;
            leastUseful_.erase(leastUseful_.begin() + std::ptrdiff_t(i));
            return true;
        }
        hasRanked_ = false;
    }
    return false;
}

void BrickScheduler::setSplit(MeshBricks::Number brick, bool isSplit) {
    if (brick >= isSplit_.size()) isSplit_.resize(bricks_.count());
    isSplit_[brick] = isSplit;
}

bool BrickScheduler::merge(MeshBricks::Number brick) {
    const DepthKey key = bricks_.key(brick);
    if (!tree_.merge(key)) return false;
    setSplit(brick, false);
    const TreeChange change = tree_.change();
    for (const GrowingLeaf& leaf : change.removed) memory_.release(numberOf(brick, leaf.key));
    publish(brick, change.removed, change.added);
    return true;
}

ScheduleProgress BrickScheduler::progress() const {
    return {tree_.leafCount(), plan_ ? plan_->leafCount() : bricks_.roots().size(), reserved_, bytes(),
            budgetBytes_};
}

bool BrickScheduler::update(Clock::time_point deadline, const Execution& execution) {
    if (isAtRest_) return true;
    const std::int64_t published = counts_.published;
    isAtRest_ = workUntil(deadline, execution);
    if (counts_.published > published) target_.progress(progress());
    if (isAtRest_) target_.rest();
    return isAtRest_;
}

// True when nothing is left to do.
bool BrickScheduler::workUntil(Clock::time_point deadline, const Execution& execution) {
    if (!hasRoots_ && changes_.empty()) beginRoots();
    publishFinished();
    while (true) {
        execution.throwIfCancelled();
        const bool planGoesOn = fillQueue(deadline);
        if (changes_.empty() && !planGoesOn && !mergeLeastUseful()) return true;
        TESSERA_CHECK(!changes_.empty() || !planGoesOn || next_ || Clock::now() >= deadline || !hasRoots_ ||
                          plan().waitsFor().empty(),
                      "a plan waits for bricks that nobody samples");
        if (!changes_.empty())
            sampling_.work(deadline, execution, [&] {
                if (publishFinished()) fillQueue(deadline);
            });
        publishFinished();
        if (Clock::now() >= deadline) return false;
    }
}

void BrickScheduler::showCoarsest(const Execution& execution) {
    if (hasRoots_ || !passing_) return;
    if (!changes_.empty()) {
        abandon(changes_.front());
        changes_.pop_front();
    }
    const PlanFrame& frame = bricks_.frame();
    std::vector<IndexBox> boxes;
    for (const Vec3i& root : bricks_.roots())
        boxes.push_back({root * frame.brickCells, (root + 1) * frame.brickCells + 1});
    std::vector<std::shared_ptr<const Block>> samples(boxes.size());
    passing_->resample(
        Lattice::axisParallel(frame.originWorld, frame.rootSpacingWorld), boxes,
        [&](std::size_t root, const Block& block) { samples[root] = std::make_shared<const Block>(block); },
        execution.withoutProgress());
    for (std::size_t root = 0; root < samples.size(); ++root)
        memory_.add(MeshBricks::Number(root), std::move(samples[root]));
    counts_.sampled += std::int64_t(samples.size());
    show(Change{});
}

void BrickScheduler::finish(const Execution& execution) {
    while (!update(Clock::now() + std::chrono::hours(1), execution)) {
    }
}

std::shared_ptr<const Block> BrickScheduler::samples(const DepthKey& key) const {
    return tree_.findLeaf(key) || tree_.isSplit(key) ? memory_.find(*bricks_.find(key)) : nullptr;
}

void BrickScheduler::forget() {
    const std::size_t before = memory_.brickCount();
    memory_.dropAll();
    counts_.dropped += std::int64_t(before - memory_.brickCount());
}

}  // namespace tessera
