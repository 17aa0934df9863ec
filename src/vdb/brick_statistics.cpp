#include "vdb/brick_statistics.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string_view>

#include "base/parallel.h"
#include "files/base64.h"
#include "refine/visible_values.h"
#include "tessera/error.h"
#include "vdb/vdb_metadata.h"

namespace tessera {

namespace {

constexpr std::uint32_t kStatisticsVersion = 1;

bool hasValue(const Tile& tile, const GridPlan& plan, int offset) {
    bool isFinite = tile.covered(offset);
    for (int c = 0; isFinite && c < plan.components; ++c)
        isFinite = std::isfinite(tile.channel(plan.firstChannel + c)[offset]);
    return isFinite;
}

/// Calls visit(channel, value) for every sample of a brick.
template <class Visit>
void visitSamples(const std::vector<GridPlan>& plans, const BrickStore& store, std::size_t brick,
                  const Visit& visit) {
    for (int t = 0; t < store.tileCount(); ++t) {
        const Tile* tile = store.tile(brick, t);
        if (!tile) continue;
        for (const GridPlan& plan : plans)
            for (int offset = 0; offset < kTilePoints; ++offset) {
                if (!hasValue(*tile, plan, offset)) continue;
                for (int c = plan.firstChannel; c < plan.firstChannel + plan.components; ++c)
                    visit(c, tile->channel(c)[offset]);
            }
    }
}

/// The histograms of one brick.
struct BrickBins {
    std::vector<BinCount> bins;
    std::vector<std::size_t> counts;  // bins of each channel
};

class StatisticsWriter {
  public:
    void word(std::uint32_t value) {
        for (int shift = 0; shift < 32; shift += 8) bytes_ += char(value >> shift & 255);
    }
    void real(float value) { word(std::bit_cast<std::uint32_t>(value)); }
    void count(std::uint32_t value) {
        for (; value >= 128; value >>= 7) bytes_ += char((value & 127) | 128);
        bytes_ += char(value);
    }
    const std::string& bytes() const { return bytes_; }

  private:
    std::string bytes_;
};

[[noreturn]] void refuseStatistics(const std::string& why) {
    throw InputError("damaged Tessera metadata: tessera_brick_statistics " + why);
}

class StatisticsReader {
  public:
    explicit StatisticsReader(std::string_view bytes) : bytes_(bytes) {}

    std::uint32_t word() {
        std::uint32_t value = 0;
        for (int shift = 0; shift < 32; shift += 8) value |= byte() << shift;
        return value;
    }
    float real() { return std::bit_cast<float>(word()); }
    std::uint32_t count() {
        std::uint32_t value = 0;
        for (int shift = 0; shift < 32; shift += 7) {
            const std::uint32_t next = byte();
            if (shift == 28 && next > 15) break;
            value |= (next & 127) << shift;
            if (next < 128) return value;
        }
        refuseStatistics("has a count of more than 32 bits");
    }
    bool isAtEnd() const { return bytes_.empty(); }

  private:
    std::uint32_t byte() {
        if (bytes_.empty()) refuseStatistics("ends early");
        const auto value = static_cast<unsigned char>(bytes_.front());
        bytes_.remove_prefix(1);
        return value;
    }

    std::string_view bytes_;
};

std::string brickText(std::size_t brick) {
    return "of brick " + std::to_string(brick);
}

/// One range and its histogram, which are added to the others.
void readChannel(StatisticsReader& reader, std::size_t brick, std::int64_t brickPoints,
                 BrickStatistics& statistics) {
    const std::uint32_t binCount = reader.count();
    if (binCount > kValueBins)
        refuseStatistics(brickText(brick) + " has " + std::to_string(binCount) + " bins");
    BrickStatistics::Range& range = statistics.ranges.emplace_back();
    statistics.firstBins.push_back(statistics.bins.size());
    if (binCount == 0) return;
    range.min = reader.real();
    range.max = reader.real();
    if (!std::isfinite(range.min) || !std::isfinite(range.max) || range.min > range.max)
        refuseStatistics(brickText(brick) + " has a range that is none");
    std::int64_t bin = -1, samples = 0;
    for (std::uint32_t b = 0; b < binCount; ++b) {
        bin += 1 + std::int64_t(reader.count());
        const std::uint32_t count = reader.count();
        samples += count;
        if (bin >= kValueBins || count == 0 || samples > brickPoints)
            refuseStatistics(brickText(brick) + " has a histogram that no brick can have");
        statistics.bins.push_back({std::uint8_t(bin), count});
    }
}

}  // namespace

ValueRange BrickStatistics::channelRange(int channel) const {
    ValueRange all;
    for (std::size_t brick = 0; brick < brickCount(); ++brick) {
        all.min = std::min(all.min, double(range(brick, channel).min));
        all.max = std::max(all.max, double(range(brick, channel).max));
    }
    return all;
}

BrickStatistics measureStatistics(const std::vector<OutputField>& fields, const BrickStore& store,
                                  const Execution& execution) {
    const std::vector<GridPlan> plans = planGrids(fields);
    const auto bricks = std::int64_t(store.leafCount());
    const auto channels = std::size_t(store.channels());
    BrickStatistics statistics;
    statistics.channels = store.channels();
    statistics.errors.assign(store.leafCount(), std::numeric_limits<float>::quiet_NaN());
    statistics.ranges.resize(store.leafCount() * channels);
    parallelFor(execution, bricks, [&](std::int64_t brick) {
        BrickStatistics::Range* ranges = &statistics.ranges[std::size_t(brick) * channels];
        visitSamples(plans, store, std::size_t(brick), [&](int channel, float value) {
            ranges[channel].min = std::min(ranges[channel].min, value);
            ranges[channel].max = std::max(ranges[channel].max, value);
        });
    });
    std::vector<ValueRange> all;
    for (int c = 0; c < statistics.channels; ++c) all.push_back(statistics.channelRange(c));

    std::vector<BrickBins> binned(store.leafCount());
    parallelFor(execution, bricks, [&](std::int64_t brick) {
        std::vector<std::uint32_t> counts(channels * kValueBins);
        visitSamples(plans, store, std::size_t(brick), [&](int channel, float value) {
            const auto c = std::size_t(channel);
            ++counts[c * kValueBins + std::size_t(binOf(all[c], double(value)))];
        });
        BrickBins& one = binned[std::size_t(brick)];
        for (std::size_t c = 0; c < channels; ++c) {
            const std::size_t before = one.bins.size();
            for (std::size_t b = 0; b < kValueBins; ++b)
                if (const std::uint32_t samples = counts[c * kValueBins + b]; samples > 0)
                    one.bins.push_back({std::uint8_t(b), samples});
            one.counts.push_back(one.bins.size() - before);
        }
    });
    statistics.firstBins.push_back(0);
    for (BrickBins& one : binned) {
        for (const std::size_t count : one.counts)
            statistics.firstBins.push_back(statistics.firstBins.back() + count);
        statistics.bins.insert(statistics.bins.end(), one.bins.begin(), one.bins.end());
        one = {};
    }
    return statistics;
}

std::int64_t countSameSamples(const BrickStatistics& a, const BrickStatistics& b) {
    std::int64_t same = 0;
    for (std::size_t brick = 0; brick < a.brickCount(); ++brick) {
        bool isSame = true;
        for (int c = 0; isSame && c < a.channels; ++c)
            isSame = a.range(brick, c) == b.range(brick, c) &&
                     std::ranges::equal(a.histogram(brick, c), b.histogram(brick, c));
        same += isSame;
    }
    return same;
}

std::string encodeStatistics(const BrickStatistics& statistics) {
    StatisticsWriter writer;
    writer.word(kStatisticsVersion);
    writer.word(std::uint32_t(statistics.brickCount()));
    writer.word(std::uint32_t(statistics.channels));
    for (std::size_t brick = 0; brick < statistics.brickCount(); ++brick) {
        writer.real(statistics.errors[brick]);
        for (int c = 0; c < statistics.channels; ++c) {
            const std::span<const BinCount> bins = statistics.histogram(brick, c);
            writer.count(std::uint32_t(bins.size()));
            if (bins.empty()) continue;
            writer.real(statistics.range(brick, c).min);
            writer.real(statistics.range(brick, c).max);
            std::uint32_t next = 0;
            for (const BinCount& bin : bins) {
                writer.count(bin.bin - next);
                writer.count(bin.samples);
                next = bin.bin + 1u;
            }
        }
    }
    return encodeBase64(writer.bytes());
}

BrickStatistics decodeStatistics(const std::string& text, std::size_t bricks, int channels,
                                 std::int64_t brickPoints) {
    const std::optional<std::string> bytes = decodeBase64(text);
    if (!bytes) refuseStatistics("isn't base64");
    StatisticsReader reader(*bytes);
    if (const std::uint32_t version = reader.word(); version != kStatisticsVersion)
        refuseStatistics("has version " + std::to_string(version) + ", this program reads " +
                         std::to_string(kStatisticsVersion));
    const std::uint32_t brickCount = reader.word(), channelCount = reader.word();
    if (brickCount != bricks || channelCount != std::uint32_t(channels))
        refuseStatistics("is of " + std::to_string(brickCount) + " bricks and " +
                         std::to_string(channelCount) + " channels, the file has " + std::to_string(bricks) +
                         " and " + std::to_string(channels));
    BrickStatistics statistics;
    statistics.channels = channels;
    for (std::size_t brick = 0; brick < bricks; ++brick) {
        statistics.errors.push_back(reader.real());
        if (statistics.errors.back() < 0) refuseStatistics(brickText(brick) + " has a negative error");
        for (int c = 0; c < channels; ++c) readChannel(reader, brick, brickPoints, statistics);
    }
    statistics.firstBins.push_back(statistics.bins.size());
    if (!reader.isAtEnd()) refuseStatistics("has bytes behind the last brick");
    return statistics;
}

}  // namespace tessera
