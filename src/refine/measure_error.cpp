#include "refine/measure_error.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "base/check.h"
#include "base/parallel.h"
#include "refine/measure_kernel.h"
#include "refine/sample_errors.h"

namespace tessera {

namespace {

constexpr std::int64_t kLeafChunk = 16;
// Errors that are not negative sort as their bits do; bins by the exponent and the first bits after it.
constexpr int kBinShift = 20;
constexpr std::size_t kBins = std::size_t(0x7f800000u >> kBinShift) + 1;

struct ErrorHistogram {
    std::array<std::uint32_t, kBins> bins{};
    std::int64_t skipped = 0;
};

std::size_t binOf(float error) {
    return std::bit_cast<std::uint32_t>(error) >> kBinShift;
}

std::vector<ErrorHistogram> binErrors(const std::vector<float>& list, const Execution& execution) {
    constexpr std::int64_t kMostParts = 64;  // whatever the size: counts add up the same in any order
    const std::int64_t count = std::int64_t(list.size());
    const std::int64_t chunk = std::max(std::int64_t(65536), (count + kMostParts - 1) / kMostParts);
    std::vector<ErrorHistogram> parts(std::size_t((count + chunk - 1) / chunk));
    parallelForChunks(execution, count, chunk, [&](std::int64_t begin, std::int64_t end) {
        ErrorHistogram& part = parts[std::size_t(begin / chunk)];
        for (std::int64_t i = begin; i < end; ++i) {
            const float error = list[std::size_t(i)];
            if (error >= 0)
                ++part.bins[binOf(error)];
            else
                part.skipped += std::isnan(error);
        }
    });
    return parts;
}

// 99.9 % of the errors are at most this, in the lists' unit; also counts what was measured and what was
// skipped. Only the bin that holds the quantile is sorted.
double quantile999(const std::vector<float>& list, FieldError& result, const Execution& execution) {
    std::array<std::int64_t, kBins> total{};
    for (const ErrorHistogram& part : binErrors(list, execution)) {
        for (std::size_t bin = 0; bin < kBins; ++bin) total[bin] += part.bins[bin];
        result.skippedSamples += part.skipped;
    }
    for (const std::int64_t count : total) result.samples += count;
    if (result.samples == 0) return 0;
    std::int64_t rank = std::int64_t(std::ceil(0.999 * double(result.samples))) - 1;
    std::size_t bin = 0;
    while (rank >= total[bin]) rank -= total[bin++];
    std::vector<float> within;
    within.reserve(std::size_t(total[bin]));
    for (const float error : list)
        if (error >= 0 && binOf(error) == bin) within.push_back(error);
    const auto at = within.begin() + std::ptrdiff_t(rank);
    std::nth_element(within.begin(), at, within.end());
    return double(*at);
}

// Sums over stored points: one entry a channel, then valid points one a field.
struct StoredSums {
    std::vector<double> sum;
    std::vector<std::int64_t> valid;
    std::int64_t covered = 0;
};

double tileSum(const float* values) {
    LaneSums sums;
    measure::addValues(values, kTilePoints, sums);
    return sums.sum();
}

// Points whose components are all finite, when some are not.
void addPartlyFinite(const Tile& tile, const SampledField& sampled, double cube, StoredSums& sums,
                     std::size_t f) {
    for (int i = 0; i < kTilePoints; ++i) {
        if (!tile.covered(i)) continue;
        bool valid = true;
        for (int c = 0; c < sampled.field->components; ++c) {
            const float value = tile.channel(sampled.firstChannel + c)[i];
            if (std::isfinite(value))
                sums.sum[std::size_t(sampled.firstChannel + c)] += cube * double(value);
            else
                valid = false;
        }
        sums.valid[f] += valid;
    }
}

void addTile(const Tile& tile, std::span<const SampledField> fields, double cube, StoredSums& sums) {
    std::int64_t covered = 0;
    for (const std::uint64_t word : tile.coverage) covered += std::popcount(word);
    sums.covered += covered;
    std::array<double, 9> sum;
    for (std::size_t f = 0; f < fields.size(); ++f) {
        const int components = fields[f].field->components;
        bool finite = true;
        for (int c = 0; c < components; ++c) {
            // Uncovered points hold 0, so the plain sum is finite exactly when every covered value is.
            sum[std::size_t(c)] = tileSum(tile.channel(fields[f].firstChannel + c));
            finite = finite && std::isfinite(sum[std::size_t(c)]);
        }
        if (!finite) {
            addPartlyFinite(tile, fields[f], cube, sums, f);
            continue;
        }
        sums.valid[f] += covered;
        for (int c = 0; c < components; ++c)
            sums.sum[std::size_t(fields[f].firstChannel + c)] += cube * sum[std::size_t(c)];
    }
}

StoredSums sumStored(std::span<const SampledField> fields, const BrickTree& tree, const BrickStore& store,
                     const Execution& execution) {
    const auto empty = [&] {
        return StoredSums{std::vector<double>(std::size_t(store.channels()), 0.0),
                          std::vector<std::int64_t>(fields.size(), 0), 0};
    };
    const std::int64_t leaves = std::int64_t(tree.leafCount());
    std::vector<StoredSums> parts(std::size_t((leaves + kLeafChunk - 1) / kLeafChunk));
    parallelForChunks(execution, leaves, kLeafChunk, [&](std::int64_t begin, std::int64_t end) {
        StoredSums& part = parts[std::size_t(begin / kLeafChunk)];
        part = empty();
        for (std::int64_t leaf = begin; leaf < end; ++leaf) {
            const double h = tree.spacingWorld(tree.leaves()[std::size_t(leaf)].level);
            for (int t = 0; t < store.tileCount(); ++t)
                if (const Tile* tile = store.tile(std::size_t(leaf), t))
                    addTile(*tile, fields, h * h * h, part);
        }
    });
    StoredSums all = empty();
    for (const StoredSums& part : parts) {
        all.covered += part.covered;
        for (std::size_t c = 0; c < all.sum.size(); ++c) all.sum[c] += part.sum[c];
        for (std::size_t f = 0; f < all.valid.size(); ++f) all.valid[f] += part.valid[f];
    }
    return all;
}

FieldError fieldReport(const SampledMesh& samples, std::size_t f, const SampleErrors& errors,
                       const Execution& execution) {
    const SampledField& sampled = samples.fields()[f];
    const FieldSums& sums = errors.sums[f];
    FieldError result;
    result.name = sampled.field->name;
    result.components = sampled.field->components;
    result.location = sampled.isCell() ? "cell" : "point";
    result.range = sampled.range;
    result.max = std::max(0.0, sums.worst.error);
    if (sums.worst.error >= 0) result.worstPlaceWorld = samples.placeWorld(sums.worst.sample, Vec3d(0));
    const double unit = errorUnit(sampled);
    result.p999 = std::min(result.max, quantile999(errors.lists[f], result, execution) * unit);
    const WeightedSquares& squares = sums.squares;
    result.rms = squares.weights > 0 ? std::sqrt(squares.sum / squares.weights) * unit : 0;
    result.integralMesh = sums.integralMesh;
    if (sampled.range > 0) {
        result.relativeMax = result.max / sampled.range;
        result.relativeP999 = result.p999 / sampled.range;
        result.relativeRms = result.rms / sampled.range;
    }
    return result;
}

void countSamples(const SampleErrors& errors, ErrorReport& report) {
    report.nodes = errors.nodes;
    report.centroids = errors.centroids;
    report.outsideBricks = errors.outside;
    report.incomplete = errors.incomplete;
    report.flatElements = errors.flatElements;
    report.invertedElements = errors.invertedElements;
    const std::int64_t all = errors.nodes + errors.centroids;
    report.fullyCoveredShare = all > 0 ? double(errors.fullyCovered) / double(all) : 0;
}

}  // namespace

ErrorReport measureError(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                         const BrickStore& store, const NearestOnDemand& nearest, const Execution& execution,
                         const MeasureOptions& options) {
    const Reconstruction reconstruction(mesh, fields, tree, store, nearest, options.outside);
    std::optional<SampledMesh> own;
    if (!options.samples) own.emplace(mesh, fields, execution);
    const SampledMesh& samples = options.samples ? *options.samples : *own;
    TESSERA_CHECK(samples.fields().size() == fields.size() && samples.channels() == store.channels(),
                  "the samples are for these fields");
    execution.report(Stage::measuring, 0, 1);
    const SampleErrors errors = measureSamples(samples, tree, store, reconstruction, options.boundsWorld,
                                               execution, options.leafErrors);
    ErrorReport report;
    countSamples(errors, report);
    const StoredSums stored = sumStored(samples.fields(), tree, store, execution);
    report.coveredPoints = stored.covered;
    for (std::size_t f = 0; f < fields.size(); ++f) {
        report.fields.push_back(fieldReport(samples, f, errors, execution));
        FieldError& result = report.fields.back();
        result.validPoints = stored.valid[f];
        const auto first = stored.sum.begin() + samples.fields()[f].firstChannel;
        result.integralLattice.assign(first, first + result.components);
    }
    execution.report(Stage::measuring, 1, 1);
    return report;
}

}  // namespace tessera
