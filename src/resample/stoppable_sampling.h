#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mesh/element_index.h"
#include "tessera/lattice.h"
#include "tessera/resampler.h"

namespace tessera {

/// A call of BoundResampler::resample that stops and goes on, also within one box: for work between two
/// frames, and for coarse bricks that hold 10^5 elements. Boxes are sampled in pieces that the index finds
/// few elements near, so a piece takes about a millisecond; the samples have the same bits as by one call.
class StoppableSampling {
  public:
    /// Near a piece that takes about half a millisecond.
    static constexpr std::int64_t kPieceElements = 1024;

    /// @param bound best bound with the same index; must outlive this, as the sink's targets must.
    /// @param sink receives each box once, whole, from advance(). Throws as resample() does.
    StoppableSampling(BoundResampler& bound, std::shared_ptr<const SharedElementIndex> index,
                      const Lattice& lattice, std::span<const IndexBox> boxes, BlockSink sink);

    /// Samples pieces until the deadline has passed, one at least. True when everything is sampled. When it
    /// throws, Cancelled for one, what was being sampled is sampled again by the next call.
    bool advance(std::chrono::steady_clock::time_point deadline, const Execution& execution = {});
    /// Samples one piece. True when everything is sampled. Throws as advance() does.
    /// @param elements a piece with no more elements near it isn't cut: larger pieces cost less in all.
    bool step(std::int64_t elements = kPieceElements, const Execution& execution = {});
    bool isDone() const { return box_ == boxes_.size(); }

    /// Of the pieces so far.
    const ResampleStatistics& statistics() const { return statistics_; }

  private:
    void begin();
    void cutNext(const ElementIndex& index, std::int64_t elements);
    void copy(const Block& piece);

    BoundResampler& bound_;
    std::shared_ptr<const SharedElementIndex> index_;
    Lattice lattice_;
    std::vector<IndexBox> boxes_;
    BlockSink sink_;
    std::size_t box_ = 0;           ///< at work
    std::vector<IndexBox> pieces_;  ///< of that box, still to be sampled, the next one last
    Block block_;
    bool hasBegun_ = false;
    ResampleStatistics statistics_;
};

}  // namespace tessera
