#include "render/effects/axes.h"

#include <algorithm>
#include <cmath>
#include <glm/vec2.hpp>
#include <optional>

#include "base/round_numbers.h"

namespace tessera {

namespace {

using Pixels = glm::dvec2;

/// Dots: of ticks, between them and their numbers, and between numbers.
constexpr double kTick = 5, kGap = 3, kApart = 24;
/// An axis that is shorter in the picture has no ticks.
constexpr double kShortest = 25;

/// One of a box's edges: along an axis, at one of the two sides of each of the others.
struct Edge {
    int axis = 0;
    std::array<int, 3> sides{};  // of the other axes; 0 the lower one
};

class AxesLines {
  public:
    AxesLines(const Axes& axes, const LineView& view)
        : axes_(axes), view_(view), camera_(viewOf(view.camera)), box_(view.boundsWorld) {}

    PictureLines lines() {
        lines_.marks.dotPixels = dotPixelsOf(view_.camera);
        dot_ = lines_.marks.dotPixels;
        for (int axis = 0; axis < 3; ++axis) {
            std::optional<Edge> best;
            const bool isUpright = isSteep(axis);
            for (int n = 0; n < 4; ++n) {
                Edge edge{axis, {}};
                const int b = (axis + 1) % 3, c = (axis + 2) % 3;
                edge.sides[std::size_t(b)] = n % 2;
                edge.sides[std::size_t(c)] = n / 2;
                addLine(placeAt(edge, 0), placeAt(edge, 1));
                if (isFront(b, n % 2) == isFront(c, n / 2)) continue;  // within the box's outline, or behind
                if (!pixelsOf(placeAt(edge, 0)) || !pixelsOf(placeAt(edge, 1))) continue;
                if (!best || rankOf(edge, isUpright) > rankOf(*best, isUpright)) best = edge;
            }
            if (best) addTicks(*best);
        }
        return std::move(lines_);
    }

  private:
    /// From the lower to the upper end, 0 to 1.
    Vec3d placeAt(const Edge& edge, double share) const {
        Vec3d p;
        for (int a = 0; a < 3; ++a)
            p[a] = a == edge.axis                    ? glm::mix(box_.min[a], box_.max[a], share)
                   : edge.sides[std::size_t(a)] == 0 ? box_.min[a]
                                                     : box_.max[a];
        return p;
    }
    /// Whether a side of the box faces the eye.
    bool isFront(int axis, int side) const {
        const double sign = side == 0 ? -1 : 1;
        if (camera_.isParallel) return sign * camera_.forward[axis] < 0;
        return sign * (view_.camera.eyeWorld[axis] - (side == 0 ? box_.min : box_.max)[axis]) > 0;
    }
    /// From the top left; none behind the eye.
    std::optional<Pixels> pixelsOf(const Vec3d& p) const {
        const Vec3d d = p - view_.camera.eyeWorld;
        const double away = camera_.isParallel ? 1 : glm::dot(d, camera_.forward);
        if (!(away > 0)) return std::nullopt;
        return Pixels((glm::dot(d, camera_.right) / (away * camera_.wide) + 1) / 2 * view_.camera.widthPixels,
                      (1 - glm::dot(d, camera_.up) / (away * camera_.high)) / 2 * view_.camera.heightPixels);
    }
    /// Lower edges rank higher, or of a steep axis those further on the left; first of all those whose middle
    /// is seen.
    double rankOf(const Edge& edge, bool isSteep) const {
        const Pixels middle = 0.5 * (*pixelsOf(placeAt(edge, 0)) + *pixelsOf(placeAt(edge, 1)));
        const double wide = view_.camera.widthPixels, high = view_.camera.heightPixels;
        const bool isSeen = middle.x > 0 && middle.y > 0 && middle.x < wide && middle.y < high;
        return (isSeen ? 1e6 : 0) + (isSteep ? -middle.x : middle.y);
    }
    /// Whether an axis through the middle of the box is more upright than level in the picture.
    bool isSteep(int axis) const {
        Vec3d from = 0.5 * (box_.min + box_.max), to = from;
        from[axis] = box_.min[axis];
        to[axis] = box_.max[axis];
        const auto a = pixelsOf(from), b = pixelsOf(to);
        return a && b && std::abs(b->y - a->y) > std::abs(b->x - a->x);
    }
    void addLine(const Vec3d& from, const Vec3d& to) {
        lines_.segments.push_back({from, to, axes_.color, axes_.widthPixels});
    }

    void addTicks(const Edge& edge) {
        const Pixels from = *pixelsOf(placeAt(edge, 0)), to = *pixelsOf(placeAt(edge, 1));
        const double lengthPixels = glm::length(to - from);
        const double low = box_.min[edge.axis], high = box_.max[edge.axis];
        if (!(lengthPixels >= kShortest * dot_) || !(low < high)) return;
        const Vec3d outward = outwardOf(edge, (to - from) / lengthPixels);
        const double step =
            roundLengthAbove((high - low) / std::max(1.0, std::floor(lengthPixels / (kApart * dot_))));
        std::size_t longest = 0;
        const double last = std::floor(high / step + 1e-9);
        for (double n = std::ceil(low / step - 1e-9); n <= last; n += 1) {
            const Vec3d p = placeAt(edge, std::clamp((n * step - low) / (high - low), 0.0, 1.0));
            const auto tick = tickAt(p, outward, kTick);
            if (!tick) continue;
            addLine(p, tick->endWorld);
            const std::string text = roundNumberText(n * step, step);
            longest = std::max(longest, text.size());
            addWords(text, *tick, kGap);
        }
        // The name stands beyond the numbers.
        const auto middle = tickAt(placeAt(edge, 0.5), outward, kTick);
        if (!middle) return;
        const double words = std::abs(middle->direction.x) * double(longest) * kLetterDots[0] +
                             std::abs(middle->direction.y) * kLetterDots[1];
        const std::string name(1, char('x' + edge.axis));
        addWords(axes_.unit.empty() ? name : name + " [" + axes_.unit + "]", *middle, 3 * kGap + words);
    }

    struct Tick {
        Vec3d endWorld;
        Pixels end, direction;
    };
    /// So long in the picture, dots; none where that can't be.
    std::optional<Tick> tickAt(const Vec3d& p, const Vec3d& outward, double dots) const {
        const Vec3d size = box_.size();
        const double little = 1e-4 * std::max({size.x, size.y, size.z});
        const auto at = pixelsOf(p), beside = pixelsOf(p + little * outward);
        if (!at || !beside || !(glm::length(*beside - *at) > 0)) return std::nullopt;
        const Vec3d end = p + dots * dot_ / glm::length(*beside - *at) * little * outward;
        const auto endPixels = pixelsOf(end);
        if (!endPixels || !(glm::length(*endPixels - *at) > 0)) return std::nullopt;
        return Tick{end, *endPixels, glm::normalize(*endPixels - *at)};
    }
    /// Away from the box: both directions do, and the one that stands more across the edge is taken.
    Vec3d outwardOf(const Edge& edge, const Pixels& along) const {
        Vec3d best(0);
        double most = -1;
        for (int a = 0; a < 3; ++a) {
            if (a == edge.axis) continue;
            Vec3d outward(0);
            outward[a] = edge.sides[std::size_t(a)] == 0 ? -1 : 1;
            const auto tick = tickAt(placeAt(edge, 0.5), outward, kTick);
            if (!tick) continue;
            const double across = std::abs(along.x * tick->direction.y - along.y * tick->direction.x);
            if (across > most) most = across, best = outward;
        }
        return best;
    }
    void addWords(const std::string& text, const Tick& tick, double gapDots) {
        const Pixels place = tick.end + gapDots * dot_ * tick.direction;
        lines_.marks.words.push_back(
            {text, {place.x, place.y}, {tick.direction.x, tick.direction.y}, axes_.color});
    }

    const Axes& axes_;
    const LineView& view_;
    CameraView camera_;
    const Box3d& box_;
    PictureLines lines_;
    double dot_ = 1;
};

}  // namespace

Effect axesEffect(const Axes& axes) {
    Effect effect;
    effect.name = "axes";
    effect.marginShare = 0.07;
    effect.lines = [axes](const LineView& view) {
        return view.boundsWorld.empty() ? PictureLines{} : AxesLines(axes, view).lines();
    };
    return effect;
}

}  // namespace tessera
