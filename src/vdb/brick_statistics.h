#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "brick/brick_store.h"
#include "mesh/field_range.h"
#include "tessera/execution.h"

namespace tessera {

struct OutputField;

/// How many samples have a value in one bin.
struct BinCount {
    std::uint8_t bin = 0;
    std::uint32_t samples = 0;
    friend bool operator==(const BinCount&, const BinCount&) = default;
};

/// Range and histogram of every brick's samples, and its error: what a reader chooses bricks by before it
/// looks at samples. Bricks are in the order of the tree's leaves. The samples of a channel are those points
/// that the brick owns whose voxel in the channel's grid has a value; the extension isn't among them.
struct BrickStatistics {
    struct Range {
        float min = std::numeric_limits<float>::infinity();  ///< above max where there is no sample
        float max = -std::numeric_limits<float>::infinity();
        friend bool operator==(const Range&, const Range&) = default;
    };

    int channels = 0;
    /// One a brick: the largest error at a node or a centroid in it, of any field, over that field's range;
    /// NaN where it wasn't measured.
    std::vector<float> errors;
    std::vector<Range> ranges;           ///< brick by brick, one a channel
    std::vector<std::size_t> firstBins;  ///< of each range's histogram in `bins`; one more at the end
    std::vector<BinCount> bins;          ///< those of a histogram ascend, and none is empty

    std::size_t brickCount() const { return errors.size(); }
    const Range& range(std::size_t brick, int channel) const { return ranges[at(brick, channel)]; }
    /// By binOf(channelRange(channel), value): kValueBins bins of one width.
    std::span<const BinCount> histogram(std::size_t brick, int channel) const {
        const std::size_t i = at(brick, channel);
        return std::span(bins).subspan(firstBins[i], firstBins[i + 1] - firstBins[i]);
    }
    /// Of the samples of all bricks.
    ValueRange channelRange(int channel) const;

  private:
    std::size_t at(std::size_t brick, int channel) const {
        return brick * std::size_t(channels) + std::size_t(channel);
    }
};

/// Of the samples in a store, the errors left open.
BrickStatistics measureStatistics(const std::vector<OutputField>& fields, const BrickStore& store,
                                  const Execution& execution);
/// Bricks whose ranges and histograms are the same in both, which are of the same bricks and channels.
std::int64_t countSameSamples(const BrickStatistics& a, const BrickStatistics& b);

/// The text that a file keeps: docs/vdb_layout.md, Brick statistics.
std::string encodeStatistics(const BrickStatistics& statistics);
/// Throws InputError for text of other bricks or channels, or that is damaged. @param brickPoints that a
/// brick owns.
BrickStatistics decodeStatistics(const std::string& text, std::size_t bricks, int channels,
                                 std::int64_t brickPoints);

}  // namespace tessera
