#include "verify/point_checker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "base/check.h"
#include "base/parallel.h"
#include "resample/format_error.h"

namespace tessera {

namespace {

constexpr int kTileEdge = 16;
constexpr double kSlackVoxels = 1e-9;      // far above the rounding of distances, far below every bound
constexpr float kUndecided = 1.0f;         // as a share of what is allowed
constexpr double kHalfUlp = 0x1p-11;       // half a unit in the last place of half floats
constexpr double kSmallestHalf = 0x1p-25;  // the same of the smallest ones
constexpr float kNone = std::numeric_limits<float>::infinity();

/// One field component over one element: a linear function of the weights.
struct Line {
    std::array<double, 4> nodes{};  ///< values; of a cell field four times the same
    double low = 0, high = 0;       ///< range of the node values, rounded to float
    double largest = 0;             ///< of the absolute node values
    double highest = 0;             ///< above the lower end of the field's range
    double gradient = 0;            ///< length, per voxel
    double rounding = 0;            ///< of our own evaluation
    bool isFinite = true;
    bool isVectorFinite = true;  ///< and so are the other components of a field of three

    double at(const std::array<double, 4>& w) const {
        return nodes[0] + (nodes[1] - nodes[0]) * w[1] + (nodes[2] - nodes[0]) * w[2] +
               (nodes[3] - nodes[0]) * w[3];
    }
};

}  // namespace

PointCheck& PointCheck::operator+=(const PointCheck& later) {
    covered += later.covered;
    holes += later.holes;
    spills += later.spills;
    wrongValues += later.wrongValues;
    undecided += later.undecided;
    largestShare = std::max(largestShare, later.largestShare);
    if (firstProblem.empty()) firstProblem = later.firstProblem;
    return *this;
}

/// A part of the box that one thread checks.
class PointChecker::Tile {
  public:
    Tile(const PointChecker& checker, std::span<const Block> blocks, std::span<const SampleBounds> bounds,
         std::span<const PointRule> rules, const IndexBox& points)
        : checker_(checker), blocks_(blocks), bounds_(bounds), rules_(rules), points_(points) {
        for (const SampleBounds& b : bounds) reach_ = std::max(reach_, b.spillVoxels);
        reach_ = std::max(reach_, checker.reachVoxels_) + kSlackVoxels;
        const auto count = std::size_t(points.count());
        thinnest_.assign(count, kNone);
        isInside_.assign(count, 0);
        isNear_.assign(count * blocks.size(), 0);
        share_.assign(count * blocks.size(), kNone);
    }

    void run() {
        std::vector<std::int32_t> elements;
        checker_.voxels_.query({Vec3d(points_.min) - reach_, Vec3d(points_.max - 1) + reach_}, elements);
        for (const std::int32_t e : elements) addElement(e);
    }

    void finish(std::span<PointCheck> checks, std::vector<float>& thinnestVoxels) const {
        forEachPoint([&](const Vec3i& p, std::size_t at) {
            thinnestVoxels[blocks_[0].offset(p)] = thinnest_[at];
            for (std::size_t a = 0; a < blocks_.size(); ++a) judge(p, at, a, checks[a]);
        });
    }

  private:
    std::size_t offset(const Vec3i& p) const {
        const Vec3i n = points_.size(), q = p - points_.min;
        return (std::size_t(q.z) * std::size_t(n.y) + std::size_t(q.y)) * std::size_t(n.x) + std::size_t(q.x);
    }

    PointRule rule(const Vec3i& p) const {
        return rules_.empty() ? PointRule::sample : rules_[blocks_[0].offset(p)];
    }

    template <class Visit>
    void forEachPoint(Visit&& visit) const {
        std::size_t at = 0;
        Vec3i p;
        for (p.z = points_.min.z; p.z < points_.max.z; ++p.z)
            for (p.y = points_.min.y; p.y < points_.max.y; ++p.y)
                for (p.x = points_.min.x; p.x < points_.max.x; ++p.x) visit(p, at++);
    }

    void addElement(std::int32_t index) {
        const Box3d box = checker_.voxels_.bounds(index);
        // Clamped before they become integers: an element may be far larger than the lattice.
        const Vec3i low(glm::max(Vec3d(points_.min), glm::ceil(box.min - reach_)));
        const Vec3i high(glm::min(Vec3d(points_.max), glm::floor(box.max + reach_) + 1.0));
        if (!(low.x < high.x && low.y < high.y && low.z < high.z)) return;
        VoxelElement element;
        if (!checker_.voxels_.element(index, element)) return;
        linesAreOf_ = -1;
        Vec3i p;
        for (p.z = low.z; p.z < high.z; ++p.z)
            for (p.y = low.y; p.y < high.y; ++p.y) addRow(index, element, {low.x, p.y, p.z}, high.x);
    }

    /// The points of a row that lie within reach of every face's plane; others can't be near the element.
    void addRow(std::int32_t index, const VoxelElement& element, const Vec3i& begin, int end) {
        double first = 0, last = end - 1 - begin.x;
        if (element.isReliable()) {
            const std::array<double, 4> w = element.weights(Vec3d(begin));
            for (std::size_t i = 0; i < 4; ++i) {
                const double least = -reach_ * glm::length(element.gradients[i]) - element.weightError;
                const double step = element.gradients[i].x;
                if (step > 0) first = std::max(first, (least - w[i]) / step - kSlackVoxels);
                if (step < 0) last = std::min(last, (least - w[i]) / step + kSlackVoxels);
                if (step == 0 && w[i] < least) return;
            }
        }
        if (!(first <= last)) return;
        const int from = int(std::ceil(first)), to = int(std::floor(last));
        for (int k = from; k <= to; ++k) addPoint(index, element, {begin.x + k, begin.y, begin.z});
    }

    void addPoint(std::int32_t index, const VoxelElement& element, const Vec3i& p) {
        const std::size_t at = offset(p);
        const Vec3d place(p);
        const std::array<double, 4> w = element.weights(place);
        double depth = -1;
        if (element.isReliable()) {
            depth = std::numeric_limits<double>::infinity();
            for (std::size_t i = 0; i < 4; ++i)
                depth = std::min(depth, (w[i] - element.weightError) / glm::length(element.gradients[i]));
        }
        const double distance = depth >= 0 ? 0 : element.distance(place);
        if (depth > kSlackVoxels) isInside_[at] = 1;
        if (distance <= checker_.reachVoxels_)
            thinnest_[at] = std::min(thinnest_[at], float(element.thicknessVoxels));
        for (std::size_t a = 0; a < blocks_.size(); ++a) {
            if (distance > bounds_[a].spillVoxels + kSlackVoxels || !blocks_[a].covered(p)) continue;
            const std::size_t pair = at * blocks_.size() + a;
            isNear_[pair] = 1;
            if (rule(p) != PointRule::sample) continue;
            share_[pair] = std::min(share_[pair], shareOfAllowed(index, element, w, p, a));
        }
    }

    /// Largest over the channels; infinite when the element doesn't explain one of them.
    float shareOfAllowed(std::int32_t index, const VoxelElement& element, const std::array<double, 4>& w,
                         const Vec3i& p, std::size_t a) {
        if (linesAreOf_ != index) prepareLines(index, element);
        double worst = 0;
        const Block& block = blocks_[a];
        for (std::size_t c = 0; c < lines_.size(); ++c) {
            const Line& line = lines_[c];
            const auto value = double(block.value(int(c), p));
            if (!line.isFinite) {
                if (!std::isnan(value)) return kNone;
                continue;
            }
            if (std::isnan(value) && bounds_[a].wholeVectors && !line.isVectorFinite) continue;
            const double exact = line.at(w);
            double error =
                formatError(bounds_[a].format, checker_.channels_[c].range, line.largest, line.highest);
            // A float stays in the range of the element's values; what is kept in steps may leave it by as
            // much.
            double step = bounds_[a].format == SampleFormat::r32f ? 0 : error;
            if (!bounds_[a].isHalf.empty() && bounds_[a].isHalf[c]) {
                const double half = std::max(kHalfUlp * std::abs(value), kSmallestHalf);
                error += half;
                step += half;
            }
            if (!(value >= line.low - step && value <= line.high + step)) return kNone;
            if (line.low == line.high) {
                if (step == 0) continue;
                worst = std::max(worst, std::abs(value - line.low) / step);
                continue;
            }
            if (!element.isReliable()) {
                worst = kUndecided;
                continue;
            }
            const double allowed =
                error + line.rounding + line.gradient * (bounds_[a].placeVoxels + kSlackVoxels);
            worst = std::max(worst, std::abs(value - exact) / allowed);
            if (worst > 1) return kNone;
        }
        // Just below the mark of those that can't be decided.
        return element.isReliable() ? std::min(float(worst), std::nextafter(kUndecided, 0.0f)) : float(worst);
    }

    void prepareLines(std::int32_t index, const VoxelElement& element) {
        linesAreOf_ = index;
        lines_.assign(checker_.channels_.size(), {});
        const auto& tet = checker_.mesh_.tets[std::size_t(index)];
        for (std::size_t c = 0; c < lines_.size(); ++c) {
            const Channel& channel = checker_.channels_[c];
            const bool ofCells = channel.field->location == FieldLocation::cell;
            Line& line = lines_[c];
            line.low = std::numeric_limits<double>::infinity(), line.high = -line.low;
            double spread = 0;
            Vec3d gradient(0);
            for (std::size_t i = 0; i < 4; ++i) {
                const double f = line.nodes[i] =
                    channel.field->at(ofCells ? index : tet[i], channel.component);
                line.isFinite = line.isFinite && std::isfinite(float(f));
                line.low = std::min(line.low, double(float(f)));
                line.high = std::max(line.high, double(float(f)));
                line.largest = std::max(line.largest, std::abs(f));
                line.highest = std::max(line.highest, f - channel.range.min);
                spread += std::abs(f - line.nodes[0]);
                gradient += (f - line.nodes[0]) * element.gradients[i];
            }
            line.gradient = glm::length(gradient);
            line.rounding = spread * element.weightError;
        }
        for (std::size_t c = 0; c < lines_.size(); ++c) {
            const Channel& channel = checker_.channels_[c];
            if (channel.field->components != 3 || lines_[c].isFinite) continue;
            for (std::size_t k = 0; k < 3; ++k)
                lines_[c - std::size_t(channel.component) + k].isVectorFinite = false;
        }
    }

    void judge(const Vec3i& p, std::size_t at, std::size_t a, PointCheck& check) const {
        const std::size_t pair = at * blocks_.size() + a;
        if (rule(p) == PointRule::absent) {
            if (blocks_[a].covered(p)) note(check, check.spills, p, "is stored, though nothing needs it");
            return;
        }
        if (!blocks_[a].covered(p)) {
            if (isInside_[at]) note(check, check.holes, p, "lies in the mesh and is not covered");
            return;
        }
        ++check.covered;
        if (!isNear_[pair]) {
            note(check, check.spills, p, "is covered and lies outside the mesh");
        } else if (rule(p) != PointRule::sample) {
            return;
        } else if (share_[pair] > 1) {
            note(check, check.wrongValues, p, "has a value that no element there explains");
        } else if (share_[pair] == kUndecided) {
            ++check.undecided;
        } else {
            check.largestShare = std::max(check.largestShare, double(share_[pair]));
        }
    }

    void note(PointCheck& check, std::int64_t& counter, const Vec3i& p, const char* sentence) const {
        ++counter;
        if (!check.firstProblem.empty()) return;
        char text[160];
        std::snprintf(text, sizeof text, "lattice point (%d, %d, %d) %s", p.x, p.y, p.z, sentence);
        check.firstProblem = text;
    }

    const PointChecker& checker_;
    std::span<const Block> blocks_;
    std::span<const SampleBounds> bounds_;
    std::span<const PointRule> rules_;
    IndexBox points_;
    double reach_ = 0;
    std::vector<float> thinnest_;
    std::vector<std::uint8_t> isInside_;
    std::vector<std::uint8_t> isNear_;  // by point and block
    std::vector<float> share_;          // by point and block: least over the elements
    std::vector<Line> lines_;           // of the element at work
    std::int32_t linesAreOf_ = -1;
};

PointChecker::PointChecker(const TetMesh& mesh, const VoxelMesh& voxels, std::span<const int> fields,
                           double reachVoxels)
    : mesh_(mesh), voxels_(voxels), reachVoxels_(reachVoxels) {
    for (const int f : fields) {
        const Field& field = mesh.fields[std::size_t(f)];
        for (int c = 0; c < field.components; ++c)
            channels_.push_back({&field, c, finiteFloatRange(field, c)});
    }
}

void PointChecker::check(std::span<const Block> blocks, std::span<const SampleBounds> bounds,
                         std::span<PointCheck> checks, std::vector<float>& thinnestVoxels,
                         const Execution& execution, std::span<const PointRule> rules) const {
    TESSERA_CHECK(blocks.size() == bounds.size() && blocks.size() == checks.size(),
                  "every block has its bounds and its check");
    thinnestVoxels.clear();
    if (blocks.empty()) return;
    for (const Block& block : blocks) {
        TESSERA_CHECK(block.box == blocks[0].box, "blocks of one box are compared");
        TESSERA_CHECK(block.channels == int(channels_.size()), "a block has a channel for every component");
    }
    thinnestVoxels.assign(blocks[0].count(), kNone);
    const IndexBox& box = blocks[0].box;
    std::vector<IndexBox> tiles;
    for (int z = box.min.z; z < box.max.z; z += kTileEdge)
        for (int y = box.min.y; y < box.max.y; y += kTileEdge)
            for (int x = box.min.x; x < box.max.x; x += kTileEdge)
                tiles.push_back({{x, y, z}, glm::min(Vec3i(x, y, z) + kTileEdge, box.max)});
    std::vector<std::vector<PointCheck>> results(tiles.size(), std::vector<PointCheck>(blocks.size()));
    parallelFor(execution, std::int64_t(tiles.size()), [&](std::int64_t t) {
        Tile tile(*this, blocks, bounds, rules, tiles[std::size_t(t)]);
        tile.run();
        tile.finish(results[std::size_t(t)], thinnestVoxels);
    });
    for (const auto& ofTile : results)
        for (std::size_t a = 0; a < checks.size(); ++a) checks[a] += ofTile[a];
}

}  // namespace tessera
