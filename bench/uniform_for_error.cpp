// How many voxels a uniform lattice needs until its largest error, measured as Tessera measures its own
// output, is within a bound. The lattice is evaluated only at the corners of the cells that hold a sample, so
// lattices of 10^12 points are no problem: their values come from point location in double, and outside the
// mesh from the nearest mesh point.
//
// usage: uniform_for_error mesh field bound...      (bounds as shares of the field's range, e.g. 0.05 0.01)
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

#include "base/parallel.h"
#include "mesh/element_index.h"
#include "mesh/nearest_point.h"
#include "mesh_files/read_mesh.h"
#include "refine/error_samples.h"
#include "tessera/error.h"
#include "tessera/execution.h"

namespace tessera {
namespace {

constexpr std::int64_t kChunk = 256;

class UniformError {
  public:
    UniformError(const TetMesh& mesh, int field, const Execution& execution)
        : mesh_(mesh),
          execution_(execution),
          samples_(mesh, std::span(&field, 1), execution),
          field_(mesh.fields[std::size_t(field)]),
          index_(mesh, execution),
          nearest_(mesh, execution.threads),
          bounds_(mesh.boundsWorld()) {
        for (std::size_t s = 0; s < samples_.count(); ++s)
            if (samples_.exists(s) && !(samples_.fields()[0].isCell() && s < samples_.nodeCount()))
                order_.push_back(s);
    }

    double range() const { return samples_.fields()[0].range; }
    double longest() const {
        const Vec3d size = bounds_.size();
        return std::max({size.x, size.y, size.z});
    }

    /// Largest error with `points` lattice points along the longest axis; may stop early once it exceeds
    /// `bound`. Samples that missed the bound are tried first the next time: they decide most lattices at
    /// once.
    double largestError(std::int64_t points, double bound) {
        const double spacing = longest() / double(points - 1);
        std::atomic<double> largest{0};
        std::atomic<std::size_t> worstAt{0};
        parallelForChunks(execution_, std::int64_t(order_.size()), kChunk,
                          [&](std::int64_t begin, std::int64_t end) {
                              for (std::int64_t i = begin; i < end && largest.load() <= bound; ++i) {
                                  const double error = sampleError(order_[std::size_t(i)], spacing);
                                  double seen = largest.load();
                                  while (error > seen && !largest.compare_exchange_weak(seen, error)) {
                                  }
                                  if (error > bound) worstAt = std::size_t(i);
                              }
                          });
        if (largest > bound)
            std::rotate(order_.begin(), order_.begin() + std::ptrdiff_t(worstAt.load()),
                        order_.begin() + std::ptrdiff_t(worstAt.load()) + 1);
        return largest;
    }

    /// Lattice points of the bounds' box at that resolution.
    double boxPoints(std::int64_t points) const {
        const double spacing = longest() / double(points - 1);
        const Vec3d n = glm::floor(bounds_.size() / spacing + 1e-9) + 1.0;
        return n.x * n.y * n.z;
    }

  private:
    double sampleError(std::size_t sample, double spacing) const {
        const Vec3d index = samples_.placeWorld(sample, bounds_.min) / spacing;
        const Vec3d cell = glm::floor(index);
        Vec3d t = index - cell;
        for (int a = 0; a < 3; ++a) t[a] = t[a] < 1e-9 ? 0 : t[a] > 1 - 1e-9 ? 1 : t[a];
        std::array<double, 9> value{};
        for (int c = 0; c < 8; ++c) {
            const double weight = cornerWeight(t, c);
            if (weight == 0) continue;
            std::array<double, 9> corner;
            evaluate(bounds_.min + (cell + Vec3d(cornerOffset(c))) * spacing, spacing, corner);
            for (int k = 0; k < field_.components; ++k)
                value[std::size_t(k)] += weight * corner[std::size_t(k)];
        }
        double square = 0;
        for (int k = 0; k < field_.components; ++k) {
            const double d = value[std::size_t(k)] - samples_.exactValue(sample, field_, k);
            square += d * d;
        }
        return std::isfinite(square) ? std::sqrt(square) : 0;
    }

    // The field in the element that holds the place most deeply, or at the nearest mesh point.
    void evaluate(const Vec3d& place, double spacing, std::array<double, 9>& value) const {
        thread_local std::vector<std::int32_t> candidates;
        candidates.clear();
        index_.query({place, place}, candidates);
        double best = -1e-9;
        std::array<double, 4> weights{};
        std::int32_t element = -1;
        for (const std::int32_t e : candidates) {
            if (samples_.volumeWorld(std::size_t(e)) == 0) continue;
            const std::array<double, 4> w = barycentric(e, place);
            const double least = *std::min_element(w.begin(), w.end());
            if (!(least > best)) continue;
            best = least;
            weights = w;
            element = e;
        }
        if (element < 0) {
            NearestPoint near = nearest_.find(place, 4 * spacing);
            if (near.element < 0) near = nearest_.find(place, std::numeric_limits<double>::infinity());
            for (int k = 0; k < field_.components; ++k) value[std::size_t(k)] = near.value(field_, k);
            return;
        }
        for (int k = 0; k < field_.components; ++k) {
            double sum = 0;
            for (std::size_t n = 0; n < 4; ++n)
                sum += weights[n] * field_.at(mesh_.tets[std::size_t(element)][n], k);
            value[std::size_t(k)] = field_.location == FieldLocation::cell ? field_.at(element, k) : sum;
        }
    }

    std::array<double, 4> barycentric(std::int32_t element, const Vec3d& place) const {
        const auto& tet = mesh_.tets[std::size_t(element)];
        std::array<Vec3d, 4> v;
        for (std::size_t i = 0; i < 4; ++i) v[i] = mesh_.points[std::size_t(tet[i])] - place;
        const auto volume = [](const Vec3d& a, const Vec3d& b, const Vec3d& c) {
            return glm::dot(glm::cross(a, b), c);
        };
        std::array<double, 4> w{volume(v[1], v[3], v[2]), volume(v[0], v[2], v[3]), volume(v[0], v[3], v[1]),
                                volume(v[0], v[1], v[2])};
        const double sum = w[0] + w[1] + w[2] + w[3];
        for (double& x : w) x /= sum;
        return w;
    }

    const TetMesh& mesh_;
    const Execution& execution_;
    ErrorSamples samples_;
    const Field& field_;
    ElementIndex index_;
    NearestPointIndex nearest_;
    Box3d bounds_;
    std::vector<std::size_t> order_;
};

// Errors do not fall monotonically with resolution: scan upwards by a tenth until one fits, then bisect
// between it and the last that did not.
std::int64_t resolutionFor(UniformError& uniform, double bound, std::int64_t limit) {
    std::int64_t fails = 8, fits = 0;
    while (fits == 0) {
        const std::int64_t next = std::max(fails + 1, std::int64_t(std::ceil(double(fails) * 1.1)));
        if (next > limit) return 0;
        (uniform.largestError(next, bound) <= bound ? fits : fails) = next;
    }
    while (fits - fails > std::max<std::int64_t>(1, fits / 500)) {
        const std::int64_t middle = (fits + fails) / 2;
        (uniform.largestError(middle, bound) <= bound ? fits : fails) = middle;
    }
    return fits;
}

int run(int argc, char** argv) {
    if (argc < 4) throw InputError("usage: uniform_for_error mesh field bound...");
    const Execution execution;
    const MeshFile file = readMesh(argv[1], {}, execution);
    const int field = file.mesh.findField(argv[2]);
    if (field < 0) throw InputError(fmt::format("no field {} in {}", argv[2], argv[1]));
    UniformError uniform(file.mesh, field, execution);
    constexpr std::int64_t kLimit = 100'000'000;
    fmt::print("{:>10} {:>12} {:>12} {:>14}\n", "bound", "points", "spacing", "box points");
    for (int i = 3; i < argc; ++i) {
        const double bound = std::atof(argv[i]);
        const std::int64_t points = resolutionFor(uniform, bound * uniform.range(), kLimit);
        if (points == 0) {
            fmt::print("{:>10} more than {} points a side\n", bound, kLimit);
            continue;
        }
        fmt::print("{:>10} {:>12} {:>12.6g} {:>14.4g}\n", bound, points,
                   uniform.longest() / double(points - 1), uniform.boxPoints(points));
    }
    return 0;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
    try {
        return tessera::run(argc, argv);
    } catch (const tessera::InputError& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 2;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
