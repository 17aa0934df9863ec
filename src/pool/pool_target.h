#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "pool/brick_pool.h"
#include "pool/shown_bricks.h"
#include "schedule/brick_target.h"
#include "tessera/execution.h"

namespace tessera {

/// What a target has put into its pool so far.
struct PoolCounts {
    std::int64_t uploaded = 0;     ///< whole bricks
    std::int64_t changed = 0;      ///< bricks of which border values changed
    std::int64_t uploadBytes = 0;  ///< of texels
    std::int64_t postponed = 0;    ///< publications that the pool had no room for at once
};

/// What a pool shows of a brick.
struct BrickInPool {
    DepthKey key;
    std::uint32_t slot = 0;
    bool isCovered = false;  ///< some point of the closed box may be, or not be outside the surface
    bool isWhole = false;    ///< every point is both
    /// Of a channel: the finite values of all points of the closed box, those outside the mesh too, lie
    /// within.
    struct Channel {
        ValueRange range;
        bool isFinite = true;  ///< every value is
    };
    std::vector<Channel> channels;
};

/// Fills a pool with the bricks that a scheduler shows, border values by the seam rule. The pool goes from
/// one whole state to the next, as the scheduler does, but may be behind it: where states that frames hold
/// leave no room for the next one it is shown by a later publication, or by catchUp().
///
/// A scheduler whose budget is budgetBytes() never shows more bricks than the pool holds. With one that does,
/// as when the device had no memory for as many, the pool stays as it was until there are fewer again, and
/// catchUp() throws InputError.
class PoolTarget : public BrickTarget {
  public:
    /// Pool and mesh must outlive it; nobody else may write into the pool. @param fields those of the
    /// scheduler. @param threads of its own work, coding and values outside the mesh; 0: one for every
    /// processor.
    PoolTarget(BrickPool& pool, const TetMesh& mesh, std::span<const int> fields, int threads = 0);

    /// For bricks whose samples have values outside the mesh too, such as those of showStored().
    explicit PoolTarget(BrickPool& pool, int threads = 0);

    /// For ScheduleOptions::budgetBytes, with BrickScheduler::brickBytes(). Less keeps the pool from falling
    /// behind while frames hold states: by the slots that change during a frame.
    std::int64_t budgetBytes(std::int64_t brickBytes) const {
        return std::int64_t(pool_.capacity()) * brickBytes;
    }

    /// Throws GlError when the device fails; a later call then goes on.
    void publish(const Publication& publication) override;
    /// Shows what was published last; false when held states leave no room yet. Throws GlError as publish(),
    /// and InputError when the pool is too small for so many bricks.
    bool catchUp();
    bool isBehind() const { return isBehind_; }
    /// More bricks are shown than the pool holds.
    bool isTooSmall() const { return bricks_.leafCount() > pool_.capacity(); }

    /// What was published last.
    const ShownBricks& bricks() const { return bricks_; }
    /// The slot of a leaf in the state that the pool shows.
    std::optional<std::uint32_t> slotOf(const GrowingLeaf& leaf) const;
    /// The bricks of the state that the pool shows, in no order that means anything.
    std::vector<const BrickInPool*> shown() const;
    const PoolCounts& counts() const { return counts_; }

  private:
    /// A leaf with points that the pool doesn't show yet, or of another value.
    struct Stale {
        GrowingLeaf leaf;
        std::vector<IndexBox> parts;
    };
    struct Work {
        GrowingLeaf leaf;
        SlotUpload upload;
        BrickInPool shown;  // of the parts uploaded
    };
    /// Points of a leaf that stays whose values may change.
    struct Touched {
        GrowingLeaf leaf;
        IndexBox part;
    };

    std::vector<Touched> touchedBy(const Publication& publication) const;
    std::vector<PointValues> valuesOf(const std::vector<Touched>& touched) const;
    void note(const GrowingLeaf& leaf, const IndexBox& part);
    std::optional<BrickInPool>& inPool(std::uint32_t number);
    void look(const PointValues& points, BrickInPool& at) const;
    std::vector<Work> codeStale() const;
    bool show(std::vector<Work>& work);
    bool findSlots(std::vector<Work>& work);

    BrickPool& pool_;
    Execution execution_;
    std::optional<NearestOnDemand> nearest_;
    ShownBricks bricks_;
    BrickIndex index_;                                // numbers are slots
    std::vector<std::optional<BrickInPool>> inPool_;  // by number of the leaf
    std::map<std::uint32_t, Stale> stale_;            // by number of the leaf
    std::vector<BrickInPool> gone_;                   // what it shows and isn't published any more
    std::vector<std::uint32_t> retired_;              // slots that the index left, but not yet what is shown
    bool isBehind_ = false;
    PoolCounts counts_;
};

}  // namespace tessera
