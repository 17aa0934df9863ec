#pragma once

#include <cstddef>
#include <memory>

#include "refine/mesh_bricks.h"
#include "refine/steady_vector.h"
#include "tessera/lattice.h"

namespace tessera {

/// Sampled bricks in memory, by their numbers. Those that are held stay; of the others the one that was let
/// go first is the first to be dropped.
class BrickMemory {
  public:
    using Number = MeshBricks::Number;

    std::size_t brickCount() const { return count_; }
    bool contains(Number brick) const { return find(brick) != nullptr; }
    /// Null when it isn't there.
    std::shared_ptr<const Block> find(Number brick) const {
        return brick < entries_.size() ? entries_[brick].samples : nullptr;
    }

    /// Adds a brick that isn't there yet, held once.
    void add(Number brick, std::shared_ptr<const Block> samples);
    /// Holds a brick that is there, once more.
    void hold(Number brick);
    /// Lets go of a brick once.
    void release(Number brick);
    /// Drops a brick that nobody holds; false when there is none.
    bool dropOldest();
    /// All that nobody holds.
    void dropAll() {
        while (dropOldest()) {
        }
    }

  private:
    static constexpr Number kNone = ~Number(0);
    struct Entry {
        std::shared_ptr<const Block> samples;
        int holds = 0;
        Number before = kNone, after = kNone;  ///< let go before and after it, where nobody holds it
    };
    void unlink(const Entry& entry);

    SteadyVector<Entry> entries_;
    std::size_t count_ = 0;
    Number oldest_ = kNone, newest_ = kNone;  ///< of those that nobody holds
};

}  // namespace tessera
