#include "resample/stoppable_sampling.h"

#include <algorithm>
#include <utility>

#include "lattice/copy_points.h"
#include "resample/bound_mesh.h"
#include "resample/check_lattice.h"

namespace tessera {

namespace {

/// A piece with no more points isn't cut for them.
constexpr std::int64_t kPiecePoints = 32 * 32 * 32;

}  // namespace

StoppableSampling::StoppableSampling(BoundResampler& bound, std::shared_ptr<const SharedElementIndex> index,
                                     const Lattice& lattice, std::span<const IndexBox> boxes, BlockSink sink)
    : bound_(bound),
      index_(std::move(index)),
      lattice_(lattice),
      boxes_(boxes.begin(), boxes.end()),
      sink_(std::move(sink)) {
    checkLattice(lattice, boxes);
}

// Cuts the next piece until few elements are near it.
void StoppableSampling::cutNext(const ElementIndex& index, std::int64_t elements) {
    while (true) {
        const IndexBox piece = pieces_.back();
        const Vec3i size = piece.size();
        const int longest = std::max({size.x, size.y, size.z});
        if (longest <= 1 || (piece.count() <= kPiecePoints && areFewNear(index, lattice_, piece, elements)))
            return;
        // Memory runs along x.
        const int axis = size.z == longest ? 2 : size.y == longest ? 1 : 0;
        IndexBox low = piece, high = piece;
        low.max[axis] = high.min[axis] = piece.min[axis] + longest / 2;
        pieces_.back() = high;
        pieces_.push_back(low);
    }
}

void StoppableSampling::begin() {
    block_ = {};
    block_.lattice = lattice_;
    block_.box = boxes_[box_];
    pieces_ = {boxes_[box_]};
    hasBegun_ = true;
}

void StoppableSampling::copy(const Block& piece) {
    if (block_.coverage.empty()) {
        block_.channels = piece.channels;
        block_.values.assign(block_.count() * std::size_t(piece.channels), 0.0f);
        block_.coverage.assign(block_.count(), 0);
    }
    copyPoints(piece, piece.box, block_);
}

bool StoppableSampling::step(std::int64_t elements, const Execution& execution) {
    if (isDone()) return true;
    if (!hasBegun_) begin();
    cutNext(index_->get(execution), elements);
    const IndexBox piece = pieces_.back();
    statistics_ += bound_.resample(
        lattice_, std::span(&piece, 1), [&](std::size_t, const Block& block) { copy(block); }, execution);
    pieces_.pop_back();
    if (pieces_.empty()) {
        sink_(box_, block_);
        ++box_;
        hasBegun_ = false;
    }
    return isDone();
}

bool StoppableSampling::advance(std::chrono::steady_clock::time_point deadline, const Execution& execution) {
    while (!step(kPieceElements, execution) && std::chrono::steady_clock::now() < deadline) {
    }
    return isDone();
}

}  // namespace tessera
