#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "refine/error_samples.h"
#include "tessera/execution.h"

namespace tessera {

/// The largest error of one field among some samples; of equal ones the first sample's.
struct WorstSample {
    double error = -1;
    std::uint32_t sample = 0;
    void take(double e, std::uint32_t s) {
        if (e > error || (e == error && s < sample)) {
            error = e;
            sample = s;
        }
    }
};

/// Weighted squares of errors in units of the field's range.
struct WeightedSquares {
    double sum = 0, weights = 0;

    /// No sample, or one without an error yet, adds 0, in place of a branch that nothing could foretell.
    void add(float error, double weight) {
        const bool isMeasured = error >= 0;
        const double size = isMeasured ? double(error) : 0, share = isMeasured ? weight : 0;
        sum += share * size * size;
        weights += share;
    }
    WeightedSquares& operator+=(const WeightedSquares& other) {
        sum += other.sum;
        weights += other.weights;
        return *this;
    }
};

/// What the samples of one field add up to.
struct FieldSums {
    WorstSample worst;
    WeightedSquares squares;
    std::vector<double> integralMesh;  ///< one a component
};

/// The errors of all samples of one tree.
struct SampleErrors {
    /// One list a field, one entry a sample, in units of the field's range (field units when that is 0): NaN
    /// where skipped, -1 where there is no sample.
    std::vector<std::vector<float>> lists;
    std::vector<FieldSums> sums;  ///< one a field
    std::int64_t nodes = 0, centroids = 0, outside = 0, fullyCovered = 0, incomplete = 0;
    std::int64_t flatElements = 0, invertedElements = 0;
};

/// The unit of a field's list.
inline double errorUnit(const SampledField& field) {
    return field.range > 0 ? field.range : 1;
}

/// Measures all samples in one pass over the nodes and one over the elements. The same for any number of
/// threads.
/// @param boundsWorld samples outside count as outside and aren't measured.
/// @param leafErrors when not null: leafCount entries of 0, receive each leaf's largest relative error.
SampleErrors measureSamples(const SampledMesh& samples, const BrickTree& tree, const BrickStore& store,
                            const Reconstruction& reconstruction, const std::optional<Box3d>& boundsWorld,
                            const Execution& execution, std::vector<double>* leafErrors);

}  // namespace tessera
