#include "pool/pool_target.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/check.h"
#include "base/parallel.h"
#include "tessera/error.h"

namespace tessera {

namespace {

bool contains(const IndexBox& outer, const IndexBox& inner) {
    return intersect(outer, inner) == inner;
}

/// Both lie in one plane between them.
bool areInOnePlane(const IndexBox& a, const IndexBox& b) {
    for (int axis = 0; axis < 3; ++axis)
        if (a.min[axis] == b.min[axis] && a.size()[axis] == 1 && b.size()[axis] == 1) return true;
    return false;
}

}  // namespace

PoolTarget::PoolTarget(BrickPool& pool, const TetMesh& mesh, std::span<const int> fields, int threads)
    : pool_(pool),
      execution_{.threads = threads},
      nearest_(std::in_place, mesh, threads),
      bricks_(mesh, fields, pool.brickCells(), *nearest_) {
    TESSERA_CHECK(pool.coding().channels() == bricks_.channels(), "a pool of other channels");
}

PoolTarget::PoolTarget(BrickPool& pool, int threads)
    : pool_(pool), execution_{.threads = threads}, bricks_(pool.coding().channels(), pool.brickCells()) {}

std::optional<BrickInPool>& PoolTarget::inPool(std::uint32_t number) {
    if (number >= inPool_.size()) inPool_.resize(std::size_t(number) + 1);
    return inPool_[number];
}

std::optional<std::uint32_t> PoolTarget::slotOf(const GrowingLeaf& leaf) const {
    if (leaf.slot >= inPool_.size() || !inPool_[leaf.slot] || inPool_[leaf.slot]->key != leaf.key)
        return std::nullopt;
    return inPool_[leaf.slot]->slot;
}

std::vector<const BrickInPool*> PoolTarget::shown() const {
    std::vector<const BrickInPool*> shown;
    for (const std::optional<BrickInPool>& brick : inPool_)
        if (brick) shown.push_back(&*brick);
    for (const BrickInPool& brick : gone_) shown.push_back(&brick);
    return shown;
}

std::vector<PoolTarget::Touched> PoolTarget::touchedBy(const Publication& publication) const {
    std::vector<DepthKey> changed;
    for (const GrowingLeaf& leaf : publication.removed) changed.push_back(leaf.key);
    for (const ShownBrick& brick : publication.added) changed.push_back(brick.leaf.key);
    std::vector<Touched> touched;
    for (const GrowingLeaf& leaf : publication.findBordering())
        for (const IndexBox& part : bricks_.touchedPoints(leaf.key, changed)) touched.push_back({leaf, part});
    return touched;
}

std::vector<PointValues> PoolTarget::valuesOf(const std::vector<Touched>& touched) const {
    std::vector<PointValues> values(touched.size());
    parallelFor(execution_, std::int64_t(touched.size()), [&](std::int64_t i) {
        const Touched& one = touched[std::size_t(i)];
        values[std::size_t(i)] = bricks_.valuesAt(one.leaf, one.part);
    });
    return values;
}

// The part isn't in the pool as it is now.
void PoolTarget::note(const GrowingLeaf& leaf, const IndexBox& part) {
    Stale& stale = stale_[leaf.slot];
    stale.leaf = leaf;
    for (IndexBox& noted : stale.parts) {
        if (contains(noted, part)) return;
        if (!areInOnePlane(noted, part)) continue;
        noted = {glm::min(noted.min, part.min), glm::max(noted.max, part.max)};
        return;
    }
    stale.parts.push_back(part);
}

void PoolTarget::publish(const Publication& publication) {
    const std::vector<Touched> touched = touchedBy(publication);
    const std::vector<PointValues> before = valuesOf(touched);
    bricks_.apply(publication, execution_);
    isBehind_ = true;
    for (const GrowingLeaf& leaf : publication.removed) {
        stale_.erase(leaf.slot);
        std::optional<BrickInPool>& shown = inPool(leaf.slot);
        if (shown) gone_.push_back(std::move(*std::exchange(shown, std::nullopt)));
    }
    for (const ShownBrick& brick : publication.added) note(brick.leaf, bricks_.closedPoints(brick.leaf.key));
    const std::vector<PointValues> after = valuesOf(touched);
    for (std::size_t i = 0; i < touched.size(); ++i)
        if (!(before[i] == after[i])) note(touched[i].leaf, touched[i].part);
    if (isTooSmall() || !catchUp()) ++counts_.postponed;
}

// Takes the points into what is known of a brick.
void PoolTarget::look(const PointValues& points, BrickInPool& at) const {
    at.channels.resize(std::size_t(bricks_.channels()));
    for (std::size_t p = 0; p < points.covered.size(); ++p) {
        const bool isCovered = points.covered[p] != 0, isInside = !(points.surface[p] < 0);
        at.isCovered = at.isCovered || isCovered || isInside;
        at.isWhole = at.isWhole && isCovered && isInside;
        for (std::size_t c = 0; c < at.channels.size(); ++c) {
            const double value = points.values[p * at.channels.size() + c];
            BrickInPool::Channel& channel = at.channels[c];
            if (!std::isfinite(value)) {
                channel.isFinite = false;
                continue;
            }
            channel.range.min = std::min(channel.range.min, value);
            channel.range.max = std::max(channel.range.max, value);
        }
    }
}

std::vector<PoolTarget::Work> PoolTarget::codeStale() const {
    std::vector<Work> work;
    std::vector<const Stale*> stale;
    for (const auto& [number, one] : stale_) {
        const bool isNew = !slotOf(one.leaf);
        work.push_back(
            {one.leaf, {}, isNew ? BrickInPool{one.leaf.key, 0, false, true, {}} : *inPool_[number]});
        stale.push_back(&one);
    }
    parallelFor(execution_, std::int64_t(work.size()), [&](std::int64_t i) {
        const Stale& from = *stale[std::size_t(i)];
        const Vec3i first = bricks_.closedPoints(from.leaf.key).min;
        for (const IndexBox& part : from.parts) {
            const PointValues values = bricks_.valuesAt(from.leaf, part);
            work[std::size_t(i)].upload.parts.push_back(
                {{part.min - first, part.max - first}, pool_.coding().encode(values)});
            look(values, work[std::size_t(i)].shown);
        }
    });
    return work;
}

bool PoolTarget::catchUp() {
    if (!isBehind_) return true;
    if (isTooSmall())
        throw InputError(std::to_string(bricks_.leafCount()) + " bricks are shown, and the pool holds " +
                         std::to_string(pool_.capacity()));
    if (pool_.isHeld() && pool_.freeSlots() < stale_.size()) return false;
    std::vector<Work> work = codeStale();
    // One task, so that no frame comes between.
    return pool_.thread().run([&](GlContext&) { return show(work); });
}

// Gives every piece of work its slot; false when held states leave no room.
bool PoolTarget::findSlots(std::vector<Work>& work) {
    const auto slotNow = [&](const Work& one) { return slotOf(one.leaf); };
    std::optional<std::vector<std::uint32_t>> slots = pool_.takeSlots(work.size());
    const bool isInPlace = !slots;
    if (isInPlace) {
        // The pool may have turned out to be smaller.
        if (isTooSmall()) return false;
        // Without a frame that reads them slots may be written where they stand.
        if (pool_.isHeld()) return false;
        for (const BrickInPool& gone : gone_) {
            index_.remove(gone.key);
            pool_.giveBack({&gone.slot, 1});
        }
        gone_.clear();
        pool_.giveBack(std::exchange(retired_, {}));
        const auto added =
            std::count_if(work.begin(), work.end(), [&](const Work& w) { return !slotNow(w); });
        slots = pool_.takeSlots(std::size_t(added));
        TESSERA_CHECK(slots, "fewer slots are free than leaves");
    }
    std::size_t taken = 0;
    for (Work& one : work) {
        const auto now = slotNow(one);
        one.upload.slot = isInPlace && now ? *now : (*slots)[taken++];
        if (!isInPlace) one.upload.copiedFrom = now;
    }
    return true;
}

bool PoolTarget::show(std::vector<Work>& work) {
    if (!findSlots(work)) return false;
    std::vector<SlotUpload> uploads;
    for (Work& one : work) uploads.push_back(std::move(one.upload));
    try {
        pool_.upload(uploads);
    } catch (...) {
        std::vector<std::uint32_t> unused;
        for (std::size_t i = 0; i < work.size(); ++i)
            if (slotOf(work[i].leaf) != uploads[i].slot) unused.push_back(uploads[i].slot);
        pool_.giveBack(unused);
        throw;
    }
    for (const BrickInPool& gone : gone_) {
        index_.remove(gone.key);
        retired_.push_back(gone.slot);
    }
    gone_.clear();
    std::vector<Vec3i> roots;
    for (const Work& one : work) roots.push_back(ancestorKey(one.leaf.key, Depth(0)).index);
    index_.cover(roots);
    for (std::size_t i = 0; i < work.size(); ++i) {
        const GrowingLeaf& leaf = work[i].leaf;
        const std::uint32_t slot = uploads[i].slot;
        const auto before = slotOf(leaf);
        if (before && *before != slot) retired_.push_back(*before);
        if (before != slot) index_.put(leaf.key, slot);
        work[i].shown.slot = slot;
        inPool(leaf.slot) = std::move(work[i].shown);
        ++(before ? counts_.changed : counts_.uploaded);
        for (const SlotUpload::Part& part : uploads[i].parts)
            counts_.uploadBytes += part.box.count() * pool_.coding().pointBytes();
    }
    stale_.clear();
    pool_.show(index_, retired_);
    retired_.clear();
    isBehind_ = false;
    return true;
}

}  // namespace tessera
