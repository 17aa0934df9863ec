#include "schedule/brick_memory.h"

#include <utility>

#include "base/check.h"

namespace tessera {

void BrickMemory::add(Number brick, std::shared_ptr<const Block> samples) {
    if (brick >= entries_.size()) entries_.grow(brick + std::size_t(1));
    Entry& entry = entries_[brick];
    TESSERA_CHECK(!entry.samples, "a brick was sampled twice");
    entry.samples = std::move(samples);
    entry.holds = 1;
    ++count_;
}

void BrickMemory::hold(Number brick) {
    TESSERA_CHECK(contains(brick), "a brick is held that isn't there");
    Entry& entry = entries_[brick];
    if (entry.holds++ == 0) unlink(entry);
}

void BrickMemory::release(Number brick) {
    TESSERA_CHECK(contains(brick) && entries_[brick].holds > 0, "a brick was let go that nobody holds");
    Entry& entry = entries_[brick];
    if (--entry.holds > 0) return;
    entry.before = std::exchange(newest_, brick);
    entry.after = kNone;
    (entry.before == kNone ? oldest_ : entries_[entry.before].after) = brick;
}

void BrickMemory::unlink(const Entry& entry) {
    (entry.before == kNone ? oldest_ : entries_[entry.before].after) = entry.after;
    (entry.after == kNone ? newest_ : entries_[entry.after].before) = entry.before;
}

bool BrickMemory::dropOldest() {
    if (oldest_ == kNone) return false;
    Entry& entry = entries_[oldest_];
    unlink(entry);
    entry.samples.reset();
    --count_;
    return true;
}

}  // namespace tessera
