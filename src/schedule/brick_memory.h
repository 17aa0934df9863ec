#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "brick/depth.h"
#include "brick/root_grid.h"
#include "tessera/lattice.h"

namespace tessera {

struct DepthKeyHash {
    std::size_t operator()(const DepthKey& key) const {
        return IndexHash{}(key.index) * 31 + std::size_t(key.depth.halvings());
    }
};

/// Sampled bricks in memory. Those that are held stay; of the others the one that was let go first is the
/// first to be dropped.
class BrickMemory {
  public:
    /// Makes place for so many. When there are more, a call now and then takes milliseconds for it.
    void reserve(std::size_t bricks) { bricks_.reserve(bricks); }
    std::size_t brickCount() const { return bricks_.size(); }
    bool contains(const DepthKey& key) const { return bricks_.contains(key); }
    /// Null when it isn't there.
    std::shared_ptr<const Block> find(const DepthKey& key) const;

    /// Adds a brick that isn't there yet, held once.
    void add(const DepthKey& key, std::shared_ptr<const Block> samples);
    /// Holds a brick that is there, once more.
    void hold(const DepthKey& key);
    /// Lets go of a brick once.
    void release(const DepthKey& key);
    /// Drops a brick that nobody holds; false when there is none.
    bool dropOldest();
    /// All that nobody holds.
    void dropAll() {
        while (dropOldest()) {
        }
    }

  private:
    struct Entry {
        std::shared_ptr<const Block> samples;
        int holds = 0;
        std::list<DepthKey>::iterator place;  ///< in loose_, where nobody holds it
    };
    std::unordered_map<DepthKey, Entry, DepthKeyHash> bricks_;
    std::list<DepthKey> loose_;  ///< the one let go first is the first
};

}  // namespace tessera
