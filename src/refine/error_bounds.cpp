#include "refine/error_bounds.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "mesh/field_range.h"
#include "tessera/error.h"

namespace tessera {

bool isBounded(const TetMesh& mesh, int field, const RefineOptions& options) {
    if (!options.errorFields.empty())
        return std::find(options.errorFields.begin(), options.errorFields.end(), field) !=
               options.errorFields.end();
    return mesh.fields[std::size_t(field)].location != FieldLocation::cell ||
           options.measure != ErrorMeasure::max;
}

double boundOf(const RefineOptions& options, double range) {
    return options.maxErrorIsRelative ? options.maxError * range : options.maxError;
}

std::vector<FieldBound> errorBounds(const TetMesh& mesh, std::span<const int> fields,
                                    const SampledMesh& samples, const RefineOptions& options) {
    std::vector<FieldBound> bounds;
    bool onlyCells = true;
    for (std::size_t f = 0; f < fields.size(); ++f) {
        if (!isBounded(mesh, fields[f], options)) continue;
        const Field& field = mesh.fields[std::size_t(fields[f])];
        onlyCells = onlyCells && field.location == FieldLocation::cell;
        bool anyFinite = false;
        for (int c = 0; c < field.components; ++c) anyFinite = anyFinite || !fieldRange(field, c).empty();
        if (!anyFinite)
            throw InputError("field " + field.name +
                             " has no finite value, so no error bound can hold for it");
        const double bound = boundOf(options, samples.fields()[f].range);
        if (bound == 0) continue;  // a constant field has no relative error
        // Half a unit in the last place of the largest value; below 2^-126 floats are 2^-149 apart.
        const double roundOff = std::max(std::ldexp(samples.fields()[f].largest, -24), 0x1p-150);
        if (bound < roundOff)
            throw InputError(
                "an error bound of " + shortNumber(bound) + " on field " + field.name +
                " is below what 32-bit samples of its values can hold; the smallest that makes sense is " +
                shortNumber(2 * roundOff));
        bounds.push_back({f, bound});
    }
    if (onlyCells && options.measure == ErrorMeasure::max)
        throw InputError(
            "cell fields jump from element to element, so their maximal error never falls below a bound: "
            "choose "
            "a point field, or --error-measure rms");
    return bounds;
}

}  // namespace tessera
