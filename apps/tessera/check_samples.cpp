#include "check_samples.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "mesh/element_index.h"

namespace tessera {

namespace {

// Double rounding in barycentric coordinates of badly shaped elements stays far below these, so a verdict is
// never a rounding's fault.
constexpr double kSurelyInsideShare = 1e-6;   // barycentric coordinate
constexpr double kSurelyInsideVoxels = 1e-6;  // distance to each side
constexpr double kFloatUlp = 1.0 / (1 << 23);
constexpr double kHalfUlp = 1.0 / (1 << 10);
constexpr double kSmallestHalf = 6e-8;

/// Where a point lies in one element.
struct Place {
    std::array<double, 4> weights{};   ///< barycentric
    std::array<Vec3d, 4> gradients{};  ///< of the weights, world units
    double depth = 0;                  ///< least signed distance to a side, positive inside, world units
};

/// False for an element of no volume in double.
bool locate(const TetMesh& mesh, std::int32_t element, const Vec3d& pointWorld, Place& place) {
    const auto& nodes = mesh.tets[std::size_t(element)];
    std::array<Vec3d, 4> p;
    for (std::size_t i = 0; i < 4; ++i) p[i] = mesh.points[std::size_t(nodes[i])] - pointWorld;
    place.depth = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < 4; ++i) {
        const Vec3d &a = p[(i + 1) & 3], &b = p[(i + 2) & 3], &c = p[(i + 3) & 3];
        const Vec3d normal = glm::cross(b - a, c - a);
        const double height = glm::dot(normal, p[i] - a);
        if (height == 0 || !std::isfinite(height)) return false;
        place.weights[i] = glm::dot(normal, -a) / height;
        place.gradients[i] = normal / height;
        place.depth = std::min(place.depth, place.weights[i] / glm::length(place.gradients[i]));
    }
    return true;
}

/// How far a stored value is from what this element allows; at most 0 when it is explained.
/// @param formatStep what the format that values were sampled in may cost.
double excess(const TetMesh& mesh, const Field& field, int component, std::int32_t element,
              const Place& place, double stored, double placeErrorWorld, double formatStep, bool halfFloat) {
    double exact = 0, largest = 0;
    Vec3d gradient(0);
    if (field.location == FieldLocation::cell) {
        exact = field.at(element, component);
        largest = std::abs(exact);
    } else {
        double sum = 0;
        std::array<double, 4> w{};
        for (std::size_t i = 0; i < 4; ++i) sum += w[i] = std::max(0.0, place.weights[i]);
        for (std::size_t i = 0; i < 4; ++i) {
            const double value = field.at(mesh.tets[std::size_t(element)][i], component);
            exact += w[i] / sum * value;
            gradient += place.gradients[i] * value;
            largest = std::max(largest, std::abs(value));
        }
    }
    if (!std::isfinite(exact)) return 0;  // not valid there: nothing is claimed
    double allowed = formatStep + 4 * kFloatUlp * largest + double(std::numeric_limits<float>::min()) +
                     glm::length(gradient) * (placeErrorWorld + 2 * std::max(0.0, -place.depth));
    if (halfFloat) allowed += kHalfUlp * largest + kSmallestHalf;
    return std::abs(stored - exact) - allowed;
}

/// Sampling in the format may round a value by this: one step of the normalised formats over the field's
/// range, one unit in the last place of a half float of the normalised value.
double formatStep(const std::string& format, const Field& field, int component) {
    const double range = fieldRange(field, component).width();
    if (format == "r8") return range / 255;
    if (format == "r16") return range / 65535;
    if (format == "r16f") return range * kHalfUlp;
    return 0;
}

class Checker {
  public:
    Checker(const TetMesh& mesh, std::span<const int> fields, const VdbFile& file, const Resampler& resampler,
            bool halfFloat)
        : mesh_(mesh),
          fields_(fields),
          file_(file),
          resampler_(resampler),
          halfFloat_(halfFloat),
          index_(mesh) {
        for (const int f : fields)
            for (int c = 0; c < mesh.fields[std::size_t(f)].components; ++c)
                formatSteps_.push_back(formatStep(file.sampleFormat, mesh.fields[std::size_t(f)], c));
    }

    void check(std::size_t leaf, const Vec3i& local, SampleCheck& result) {
        const BrickKey& key = file_.tree.leaves()[leaf];
        const double spacing = file_.tree.spacingWorld(key.level);
        const Vec3i point = file_.tree.ownedPoints(key).min + local;
        const Vec3d world = file_.tree.lattice(key.level).worldFromIndex(Vec3d(point));
        const bool covered = isCovered(leaf, local);
        findPlaces(world, spacing);
        ++result.points;
        result.covered += covered;
        const bool inside = std::any_of(places_.begin(), places_.end(), [&](const auto& found) {
            const auto& w = found.second.weights;
            return *std::min_element(w.begin(), w.end()) > kSurelyInsideShare &&
                   found.second.depth > kSurelyInsideVoxels * spacing;
        });
        const auto where = [&] {
            return fmt::format("level {} point ({}, {}, {})", key.level, point.x, point.y, point.z);
        };
        if (!covered && inside) note(result, result.holes, where() + " lies in the mesh and is not covered");
        if (covered && places_.empty())
            note(result, result.spills, where() + " is covered and lies outside the mesh");
        if (covered && !places_.empty()) checkValues(leaf, local, spacing, where(), result);
    }

  private:
    bool isCovered(std::size_t leaf, const Vec3i& p) const {
        const int n = file_.store.tilesPerEdge();
        const Tile* tile =
            file_.store.tile(leaf, (p.x / kTileSize * n + p.y / kTileSize) * n + p.z / kTileSize);
        return tile &&
               tile->covered((p.x % kTileSize * kTileSize + p.y % kTileSize) * kTileSize + p.z % kTileSize);
    }

    /// A value that isn't finite is right where an element there depends on one that isn't finite as a float.
    bool mayBeInvalid(const Field& field) const {
        const auto finite = [&](std::int64_t item) {
            for (int c = 0; c < field.components; ++c)
                if (!std::isfinite(float(field.at(item, c)))) return false;
            return true;
        };
        return std::any_of(places_.begin(), places_.end(), [&](const auto& found) {
            if (field.location == FieldLocation::cell) return !finite(found.first);
            const auto& nodes = mesh_.tets[std::size_t(found.first)];
            return !std::all_of(nodes.begin(), nodes.end(), [&](std::int32_t node) { return finite(node); });
        });
    }

    void note(SampleCheck& result, std::int64_t& counter, const std::string& sentence) {
        ++counter;
        if (result.firstProblem.empty()) result.firstProblem = sentence;
    }

    /// Elements within the spill bound of the point, so far as the distances to their sides tell.
    void findPlaces(const Vec3d& world, double spacing) {
        // World coordinates of lattice points are rounded; on a mesh far from the origin that can exceed the
        // bound itself.
        rounding_ = 4 * std::numeric_limits<double>::epsilon() *
                    std::max({std::abs(world.x), std::abs(world.y), std::abs(world.z)});
        const double slack = resampler_.spillBoundVoxels() * spacing + rounding_;
        Box3d box{world - Vec3d(slack), world + Vec3d(slack)};
        candidates_.clear();
        places_.clear();
        index_.query(box, candidates_);
        for (const std::int32_t element : candidates_) {
            Place place;
            if (locate(mesh_, element, world, place)) {
                if (place.depth >= -slack) places_.push_back({element, place});
            }
        }
    }

    void checkValues(std::size_t leaf, const Vec3i& local, double spacing, const std::string& where,
                     SampleCheck& result) {
        int channel = 0;
        for (const int f : fields_) {
            const Field& field = mesh_.fields[std::size_t(f)];
            for (int c = 0; c < field.components; ++c, ++channel) {
                bool covered = false;
                const double stored = file_.store.value(leaf, local, channel, covered);
                if (!std::isfinite(stored)) {
                    if (!mayBeInvalid(field))
                        note(result, result.wrongValues,
                             fmt::format("{}: {} has no finite value", where, field.name));
                    continue;
                }
                double best = std::numeric_limits<double>::infinity();
                for (const auto& [element, place] : places_)
                    best = std::min(best, excess(mesh_, field, c, element, place, stored,
                                                 resampler_.placeBoundVoxels() * spacing + rounding_,
                                                 formatSteps_[std::size_t(channel)], halfFloat_));
                if (best <= 0) continue;
                result.largestExcess = std::max(result.largestExcess, best);
                note(result, result.wrongValues,
                     fmt::format("{}: {} is {:.9g}, off by {:.3g} more than the contract allows", where,
                                 field.name, stored, best));
            }
        }
    }

    const TetMesh& mesh_;
    std::span<const int> fields_;
    const VdbFile& file_;
    const Resampler& resampler_;
    bool halfFloat_;
    std::vector<double> formatSteps_;  // one a channel
    double rounding_ = 0;              // of the world place at work
    ElementIndex index_;
    std::vector<std::int32_t> candidates_;
    std::vector<std::pair<std::int32_t, Place>> places_;
};

}  // namespace

SampleCheck checkSamples(const TetMesh& mesh, std::span<const int> fields, const VdbFile& file,
                         const Resampler& resampler, bool halfFloat, std::int64_t samples,
                         const Execution& execution) {
    SampleCheck result;
    Checker checker(mesh, fields, file, resampler, halfFloat);
    const std::int64_t edge = file.tree.brickCells();
    const std::int64_t stored = std::int64_t(file.tree.leafCount()) * edge * edge * edge;
    if (stored == 0 || samples <= 0) return result;
    // An odd stride, so that it does not fall on the same plane of every brick.
    const std::int64_t stride = std::max<std::int64_t>(1, stored / samples) | 1;
    for (std::int64_t i = stride / 2; i < stored; i += stride) {
        execution.throwIfCancelled();
        execution.report(Stage::comparing, i, stored);
        const std::int64_t rest = i % (edge * edge * edge);
        checker.check(std::size_t(i / (edge * edge * edge)),
                      {int(rest % edge), int(rest / edge % edge), int(rest / (edge * edge))}, result);
    }
    return result;
}

}  // namespace tessera
