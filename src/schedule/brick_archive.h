#pragma once

#include <memory>

#include "brick/depth.h"
#include "tessera/lattice.h"

namespace tessera {

/// Samples of bricks, kept beyond a scheduler's memory. Several threads may call at once.
class BrickArchive {
  public:
    virtual ~BrickArchive() = default;

    virtual bool contains(const DepthKey& key) const = 0;
    /// A brick that is there, with the bits that were appended. Throws InputError where they are damaged, and
    /// IoError.
    /// @param lattice, @param box of its samples.
    virtual std::shared_ptr<const Block> read(const DepthKey& key, const Lattice& lattice,
                                              const IndexBox& box) const = 0;
    /// Keeps the samples of a brick; one that is there already stays as it is. Throws IoError.
    virtual void append(const DepthKey& key, const Block& samples) = 0;
};

}  // namespace tessera
