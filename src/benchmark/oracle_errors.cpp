#include "benchmark/oracle_errors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "benchmark/quoted_text.h"
#include "compare/sampling_grid.h"
#include "mesh/field_range.h"
#include "reference/oracle.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kFewestPoints = 40, kMostPoints = 80;  // of a lattice, along the longest axis

/// A lattice that begins somewhere in the first voxel outside the bounds.
SamplingGrid randomGrid(const Box3d& bounds, std::mt19937_64& random) {
    std::uniform_real_distribution<double> unit(0, 1);
    SamplingGrid grid = cubicGrid(bounds, kFewestPoints + int(unit(random) * (kMostPoints - kFewestPoints)));
    const double spacing = grid.lattice.uWorld.x;
    for (int a = 0; a < 3; ++a) grid.lattice.originWorld[a] -= spacing * unit(random);
    grid.points.max += 2;
    return grid;
}

/// The values that are right at a lattice point: one of each element that holds it.
std::vector<std::vector<double>> valuesAt(const Oracle& oracle, const Field& field, const Vec3i& p,
                                          std::span<const Candidate> candidates) {
    std::vector<std::vector<double>> all;
    for (const Candidate& candidate : candidates) {
        if (!candidate.contains) continue;
        std::vector<double> values;
        for (int c = 0; c < field.components; ++c) {
            if (field.location == FieldLocation::cell) {
                values.push_back(field.at(candidate.element, c));
                continue;
            }
            const auto& nodes = oracle.mesh().tets[std::size_t(candidate.element)];
            const bool isFinite = std::all_of(nodes.begin(), nodes.end(),
                                              [&](std::int32_t n) { return std::isfinite(field.at(n, c)); });
            if (!isFinite) return {};
            const mpq_class exact =
                oracle.interpolate(field, c, candidate.element, oracle.barycentrics(candidate.element, p));
            values.push_back(approximateRatio(exact.get_num(), exact.get_den()));
        }
        if (!all.empty() && values == all.back()) continue;
        all.push_back(std::move(values));
    }
    return all;
}

double largestRange(const Field& field) {
    double range = 0;
    for (int c = 0; c < field.components; ++c) {
        const ValueRange values = fieldRange(field, c);
        range = std::max(range, values.width());
    }
    return range;
}

}  // namespace

ErrorFigures figuresOf(std::vector<double> errors) {
    ErrorFigures figures;
    figures.count = std::int64_t(errors.size());
    if (errors.empty()) return figures;
    std::sort(errors.begin(), errors.end());
    figures.max = errors.back();
    figures.p999 = errors[std::size_t(std::ceil(0.999 * double(errors.size()))) - 1];
    double sum = 0;
    for (const double error : errors) sum += error * error;
    figures.rms = std::sqrt(sum / double(errors.size()));
    return figures;
}

OraclePlaces::OraclePlaces(const TetMesh& mesh, int field, const OracleOptions& options,
                           const Execution& execution)
    : mesh_(mesh), field_(field) {
    const Field& values = mesh.fields[std::size_t(field)];
    range_ = largestRange(values);
    std::mt19937_64 random(options.seed);
    for (int g = 0; g < options.lattices; ++g) {
        const SamplingGrid grid = randomGrid(mesh.boundsWorld(), random);
        const Oracle oracle(mesh, grid.lattice);
        grids_.push_back({grid.lattice, referenceBlock(oracle, grid.points,
                                                       {.toleranceVoxels = options.spillVoxels}, execution)});
        const ReferenceBlock& reference = grids_.back().reference;
        std::vector<std::size_t> inside;
        for (std::size_t at = 0; at < reference.mustCover.size(); ++at)
            if (reference.mustCover[at]) inside.push_back(at);
        std::shuffle(inside.begin(), inside.end(), random);
        inside.resize(std::min(inside.size(), std::size_t(options.places / options.lattices)));
        const Vec3i n = reference.box.size();
        for (const std::size_t at : inside) {
            execution.throwIfCancelled();
            const auto flat = int(at);
            const Vec3i p = reference.box.min + Vec3i(flat % n.x, flat / n.x % n.y, flat / n.x / n.y);
            Place place{grids_.size() - 1, p, valuesAt(oracle, values, p, reference.candidatesOf(at))};
            if (!place.values.empty()) places_.push_back(std::move(place));
        }
    }
    if (places_.empty()) throw InputError("no lattice point lies in the mesh: its elements are too thin");
}

double OraclePlaces::errorAt(const Place& place, std::span<const float> values) const {
    double least = std::numeric_limits<double>::infinity();
    for (const std::vector<double>& exact : place.values) {
        double square = 0;
        for (std::size_t c = 0; c < exact.size(); ++c)
            square += (double(values[c]) - exact[c]) * (double(values[c]) - exact[c]);
        least = std::min(least, std::sqrt(square));
    }
    return range_ > 0 || !std::isfinite(least) ? least / range_ : 0;
}

OracleFigures OraclePlaces::measure(const Resampler& resampler, const BindOptions& bind,
                                    const Execution& execution) const {
    const int components = mesh_.fields[std::size_t(field_)].components;
    OracleFigures figures;
    std::vector<double> errors;
    const auto bound = resampler.bind(mesh_, std::span(&field_, 1), bind);
    for (std::size_t g = 0; g < grids_.size(); ++g) {
        const Grid& grid = grids_[g];
        Block block;
        bound->resample(
            grid.lattice, std::span(&grid.reference.box, 1),
            [&](std::size_t, const Block& sampled) { block = sampled; }, execution.withoutProgress());
        for (std::size_t at = 0; at < grid.reference.mustCover.size(); ++at) {
            figures.holes += grid.reference.mustCover[at] && !block.coverage[at];
            figures.spills += block.coverage[at] && !grid.reference.mayCover(at);
        }
        for (const Place& place : places_) {
            if (place.grid != g) continue;
            const bool isCovered = block.covered(place.index);
            std::vector<float> values;
            for (int c = 0; c < components; ++c)
                values.push_back(isCovered ? block.value(c, place.index)
                                           : std::numeric_limits<float>::quiet_NaN());
            figures.values.insert(figures.values.end(), values.begin(), values.end());
            const double error = errorAt(place, values);
            if (std::isfinite(error)) errors.push_back(error);
        }
    }
    figures.error = figuresOf(std::move(errors));
    return figures;
}

std::string OraclePlaces::csv(const std::vector<std::string>& names,
                              const std::vector<OracleFigures>& figures) const {
    const auto components = std::size_t(mesh_.fields[std::size_t(field_)].components);
    std::string text = "lattice,i,j,k,x,y,z,spacing,exact";
    for (const std::string& name : names) text += "," + csvText(name);
    text += '\n';
    for (std::size_t p = 0; p < places_.size(); ++p) {
        const Place& place = places_[p];
        const Lattice& lattice = grids_[place.grid].lattice;
        text += fmt::format("{},{},{},{},{},{},{},{},{}", place.grid, place.index.x, place.index.y,
                            place.index.z, lattice.originWorld.x, lattice.originWorld.y,
                            lattice.originWorld.z, lattice.uWorld.x, place.values[0][0]);
        for (const OracleFigures& of : figures) text += fmt::format(",{}", of.values[p * components]);
        text += '\n';
    }
    return text;
}

}  // namespace tessera
