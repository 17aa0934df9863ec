#include "brick/measure_error.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "brick/error_samples.h"

namespace tessera {

namespace {

constexpr std::int64_t kLeafChunk = 16;
constexpr std::int64_t kElementChunk = 16384;
constexpr double kNodeWeight = 1.0 / 20, kCentroidWeight = 4.0 / 5;

// The largest error of one field among the samples of one leaf or of all.
struct Worst {
    double error = -1;
    std::uint32_t sample = 0;
    void take(double e, std::uint32_t s) {
        if (e > error || (e == error && s < sample)) {
            error = e;
            sample = s;
        }
    }
};

// Errors of every sample, one list a field, as floats in units of the field's range: NaN where skipped, -1
// where there is no sample.
using ErrorLists = std::vector<std::vector<float>>;

struct SampleTotals {
    std::vector<Worst> worst;  // one a field
    std::int64_t fullyCovered = 0;
};

double unitOf(const SampledField& field) {
    return field.range > 0 ? field.range : 1;
}

SampleTotals measureSamples(const ErrorSamples& samples, const SamplesByLeaf& sorted, const BrickTree& tree,
                            const BrickStore& store, const Reconstruction& reconstruction, ErrorLists& lists,
                            const Execution& execution, std::vector<double>* leafErrors) {
    const std::size_t fields = samples.fields().size();
    const std::int64_t leaves = std::int64_t(tree.leafCount());
    const std::size_t chunks = std::size_t((leaves + kLeafChunk - 1) / kLeafChunk);
    std::vector<SampleTotals> totals(chunks);
    parallelForChunks(execution, leaves, kLeafChunk, [&](std::int64_t begin, std::int64_t end) {
        SampleTotals& total = totals[std::size_t(begin / kLeafChunk)];
        total.worst.resize(fields);
        LeafSampler sampler(samples, tree, store, reconstruction);
        std::vector<double> errors(fields);
        for (std::int64_t leaf = begin; leaf < end; ++leaf) {
            if (sorted.of(std::size_t(leaf)).empty()) continue;
            sampler.enter(std::size_t(leaf));
            double largest = 0;
            for (const std::uint32_t sample : sorted.of(std::size_t(leaf))) {
                total.fullyCovered += sampler.measure(sample, errors) ? 1 : 0;
                for (std::size_t f = 0; f < fields; ++f) {
                    const double unit = unitOf(samples.fields()[f]);
                    lists[f][sample] = errors[f] < 0 ? -1.0f : float(errors[f] / unit);
                    total.worst[f].take(errors[f], sample);
                    if (samples.fields()[f].range > 0 && errors[f] > largest * unit)
                        largest = errors[f] / unit;
                }
            }
            if (leafErrors) (*leafErrors)[std::size_t(leaf)] = largest;
        }
    });
    SampleTotals all;
    all.worst.resize(fields);
    for (const SampleTotals& total : totals) {
        all.fullyCovered += total.fullyCovered;
        for (std::size_t f = 0; f < fields; ++f)
            if (total.worst[f].error >= 0) all.worst[f].take(total.worst[f].error, total.worst[f].sample);
    }
    return all;
}

// 99.9 % of the errors are at most this, in the lists' unit; also counts what was measured and what was
// skipped.
double quantile999(const std::vector<float>& list, FieldError& result) {
    std::vector<float> measured;
    measured.reserve(list.size());
    for (const float error : list) {
        if (error >= 0) measured.push_back(error);
        result.skippedSamples += std::isnan(error);
    }
    result.samples = std::int64_t(measured.size());
    if (measured.empty()) return 0;
    const auto at = measured.begin() + std::ptrdiff_t(std::ceil(0.999 * double(measured.size())) - 1);
    std::nth_element(measured.begin(), at, measured.end());
    return double(*at);
}

// Sums over elements: weighted squared errors, and the integral of the exact field.
struct ElementSums {
    double squares = 0, weights = 0;
    std::vector<double> integral;
};

ElementSums sumElements(const ErrorSamples& samples, const SampledField& sampled,
                        const std::vector<float>& list, std::int64_t begin, std::int64_t end) {
    ElementSums sums;
    const Field& field = *sampled.field;
    sums.integral.assign(std::size_t(field.components), 0);
    const std::size_t nodes = samples.nodeCount();
    const auto take = [&](std::size_t sample, double weight) {
        const double error = double(list[sample]);
        if (!(error >= 0)) return;
        sums.squares += weight * error * error;
        sums.weights += weight;
    };
    for (std::int64_t e = begin; e < end; ++e) {
        const double volume = samples.volumeWorld(std::size_t(e));
        if (volume == 0) continue;
        const std::size_t centroid = nodes + std::size_t(e);
        take(centroid, sampled.isCell() ? volume : kCentroidWeight * volume);
        if (!sampled.isCell())
            for (const std::int32_t node : samples.mesh().tets[std::size_t(e)])
                take(std::size_t(node), kNodeWeight * volume);
        for (int c = 0; c < field.components; ++c) {
            const double mean = samples.exactValue(centroid, field, c);
            if (std::isfinite(mean)) sums.integral[std::size_t(c)] += volume * mean;
        }
    }
    return sums;
}

void sumOverElements(const ErrorSamples& samples, const SampledField& sampled, const std::vector<float>& list,
                     FieldError& result, const Execution& execution) {
    const std::int64_t count = samples.mesh().elementCount();
    std::vector<ElementSums> parts(std::size_t((count + kElementChunk - 1) / kElementChunk));
    parallelForChunks(execution, count, kElementChunk, [&](std::int64_t begin, std::int64_t end) {
        parts[std::size_t(begin / kElementChunk)] = sumElements(samples, sampled, list, begin, end);
    });
    double squares = 0, weights = 0;
    result.integralMesh.assign(std::size_t(result.components), 0);
    for (const ElementSums& part : parts) {
        squares += part.squares;
        weights += part.weights;
        for (std::size_t c = 0; c < result.integralMesh.size(); ++c)
            result.integralMesh[c] += part.integral[c];
    }
    result.rms = weights > 0 ? std::sqrt(squares / weights) * unitOf(sampled) : 0;
}

// Sums over stored points: one entry a channel, then valid points one a field.
struct StoredSums {
    std::vector<double> sum;
    std::vector<std::int64_t> valid;
    std::int64_t covered = 0;
};

double tileSum(const float* values) {
    double part[8] = {};
    for (int i = 0; i < kTilePoints; i += 8)
        for (int j = 0; j < 8; ++j) part[j] += double(values[i + j]);
    return ((part[0] + part[1]) + (part[2] + part[3])) + ((part[4] + part[5]) + (part[6] + part[7]));
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

FieldError fieldReport(const ErrorSamples& samples, const SampledField& sampled,
                       const std::vector<float>& list, const Worst& worst, const Execution& execution) {
    FieldError result;
    result.name = sampled.field->name;
    result.components = sampled.field->components;
    result.location = sampled.isCell() ? "cell" : "point";
    result.range = sampled.range;
    result.max = std::max(0.0, worst.error);
    if (worst.error >= 0) result.worstPlaceWorld = samples.placeWorld(worst.sample, Vec3d(0));
    result.p999 = std::min(result.max, quantile999(list, result) * unitOf(sampled));
    sumOverElements(samples, sampled, list, result, execution);
    if (sampled.range > 0) {
        result.relativeMax = result.max / sampled.range;
        result.relativeP999 = result.p999 / sampled.range;
        result.relativeRms = result.rms / sampled.range;
    }
    return result;
}

void countSamples(const ErrorSamples& samples, const SamplesByLeaf& sorted, std::int64_t fullyCovered,
                  ErrorReport& report) {
    for (const std::uint32_t sample : sorted.ids)
        ++(sample < samples.nodeCount() ? report.nodes : report.centroids);
    report.outsideBricks = sorted.outside;
    report.flatElements = samples.flatElements();
    report.invertedElements = samples.invertedElements();
    report.fullyCoveredShare = sorted.ids.empty() ? 0 : double(fullyCovered) / double(sorted.ids.size());
}

ErrorReport measureWith(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                        const BrickStore& store, const Reconstruction& reconstruction,
                        const Execution& execution, const MeasureOptions& options) {
    std::optional<ErrorSamples> own;
    if (!options.samples) own.emplace(mesh, fields, execution);
    const ErrorSamples& samples = options.samples ? *options.samples : *own;
    TESSERA_CHECK(samples.fields().size() == fields.size() && samples.channels() == store.channels(),
                  "the samples are for these fields");
    if (options.leafErrors) options.leafErrors->assign(tree.leafCount(), 0.0);
    execution.report("verify", 0, 3);
    const SamplesByLeaf sorted = sortSamples(samples, tree, options.boundsWorld, execution);
    execution.report("verify", 1, 3);
    ErrorLists lists(fields.size(), std::vector<float>(samples.count(), -1.0f));
    const SampleTotals totals =
        measureSamples(samples, sorted, tree, store, reconstruction, lists, execution, options.leafErrors);
    execution.report("verify", 2, 3);

    ErrorReport report;
    countSamples(samples, sorted, totals.fullyCovered, report);
    const StoredSums stored = sumStored(samples.fields(), tree, store, execution);
    report.coveredPoints = stored.covered;
    for (std::size_t f = 0; f < fields.size(); ++f) {
        const SampledField& sampled = samples.fields()[f];
        report.fields.push_back(fieldReport(samples, sampled, lists[f], totals.worst[f], execution));
        FieldError& result = report.fields.back();
        result.validPoints = stored.valid[f];
        const auto first = stored.sum.begin() + sampled.firstChannel;
        result.integralLattice.assign(first, first + result.components);
    }
    execution.report("verify", 3, 3);
    return report;
}

}  // namespace

ErrorReport measureError(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                         const BrickStore& store, const NearestPointIndex& nearest,
                         const Execution& execution, const MeasureOptions& options) {
    return measureWith(mesh, fields, tree, store, Reconstruction(mesh, fields, tree, store, nearest),
                       execution, options);
}

ErrorReport measureError(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                         const BrickStore& store, const NearestOnDemand& nearest, const Execution& execution,
                         const MeasureOptions& options) {
    return measureWith(mesh, fields, tree, store, Reconstruction(mesh, fields, tree, store, nearest),
                       execution, options);
}

}  // namespace tessera
