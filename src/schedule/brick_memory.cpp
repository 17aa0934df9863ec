#include "schedule/brick_memory.h"

#include <utility>

#include "base/check.h"

namespace tessera {

std::shared_ptr<const Block> BrickMemory::find(const DepthKey& key) const {
    const auto found = bricks_.find(key);
    return found == bricks_.end() ? nullptr : found->second.samples;
}

void BrickMemory::add(const DepthKey& key, std::shared_ptr<const Block> samples) {
    const auto [place, isNew] = bricks_.try_emplace(key, Entry{std::move(samples), 1, {}});
    TESSERA_CHECK(isNew, "a brick was sampled twice");
}

void BrickMemory::hold(const DepthKey& key) {
    Entry& entry = bricks_.at(key);
    if (entry.holds++ == 0) loose_.erase(entry.place);
}

void BrickMemory::release(const DepthKey& key) {
    Entry& entry = bricks_.at(key);
    TESSERA_CHECK(entry.holds > 0, "a brick was let go that nobody holds");
    if (--entry.holds == 0) entry.place = loose_.insert(loose_.end(), key);
}

bool BrickMemory::dropOldest() {
    if (loose_.empty()) return false;
    bricks_.erase(loose_.front());
    loose_.pop_front();
    return true;
}

}  // namespace tessera
