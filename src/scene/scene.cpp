#include "scene/scene.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "refine/camera_view.h"
#include "scene/colour_maps.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Of the picture's width or height, around what is shown.
constexpr double kMargin = 0.06;
/// Of the longest side, the usual radius of a focus.
constexpr double kFocusSizes = 16;
/// Stops along a map; between them values are linear, so a logarithmic scale needs many.
constexpr int kSteps = 64, kLogarithmicSteps = 512;
/// Of the rarest values, and of the most frequent ones, which show where the mesh is.
constexpr double kMostOpacity = 0.6, kLeastOpacity = 0.004;

double opacityAt(const std::vector<std::array<double, 2>>& opacities, double share) {
    const auto above = std::find_if(opacities.begin(), opacities.end(),
                                    [&](const std::array<double, 2>& at) { return at[0] > share; });
    if (above == opacities.begin()) return opacities.front()[1];
    if (above == opacities.end()) return opacities.back()[1];
    const std::array<double, 2>& below = *(above - 1);
    return between({below[0], {}, below[1]}, {(*above)[0], {}, (*above)[1]}, share).opacity;
}

/// What most of the mesh has is clear, so that what is rare is seen in it.
std::vector<std::array<double, 2>> opacitiesOf(std::span<const double> histogram) {
    const double most = histogram.empty() ? 0 : *std::max_element(histogram.begin(), histogram.end());
    if (!(most > 0)) return {{0, kMostOpacity}};
    std::vector<std::array<double, 2>> opacities;
    for (std::size_t bin = 0; bin < histogram.size(); ++bin) {
        const double opacity =
            std::max(kLeastOpacity, kMostOpacity * (1 - std::pow(histogram[bin] / most, 0.3)));
        // Even over most of the bin: what half the mesh has may lie anywhere in it.
        for (const double at : {0.1, 0.9})
            opacities.push_back({(double(bin) + at) / double(histogram.size()), opacity});
    }
    return opacities;
}

/// So far back along `forward` that the box is within the picture.
Camera fitted(Camera camera, const Box3d& box, bool isParallel, int legendPixels, double margin) {
    const Vec3d middle = 0.5 * (box.min + box.max);
    camera.eyeWorld = middle;
    const CameraView view = viewOf(camera);
    const double besides = std::min(double(legendPixels) / camera.widthPixels, 0.25);
    const double shareWide = 1 - 2 * std::max(margin, besides), shareHigh = 1 - 2 * margin;
    const double wide = shareWide * view.wide, high = shareHigh * view.high;
    double back = 0, halfHeight = 0, deepest = 0;
    for (unsigned c = 0; c < 8; ++c) {
        Vec3d corner;
        for (int a = 0; a < 3; ++a) corner[a] = (c >> a & 1 ? box.max : box.min)[a];
        const Vec3d p = corner - middle;
        const double x = std::abs(glm::dot(p, view.right)), y = std::abs(glm::dot(p, view.up));
        const double depth = glm::dot(p, view.forward);
        back = std::max({back, x / wide - depth, y / high - depth});
        halfHeight =
            std::max({halfHeight, y / shareHigh, x / shareWide * camera.heightPixels / camera.widthPixels});
        deepest = std::max(deepest, std::abs(depth));
    }
    if (isParallel) {
        camera.heightWorld = 2 * halfHeight;
        back = 2 * deepest;
    }
    camera.eyeWorld = middle - back * view.forward;
    return camera;
}

}  // namespace

Camera cameraOf(const Scene& scene, const Box3d& boundsWorld, int legendPixels) {
    const SceneCamera& from = scene.camera;
    Camera camera;
    camera.widthPixels = scene.width;
    camera.heightPixels = scene.height;
    camera.openingDegrees = from.openingDegrees;
    camera.upWorld = from.up;
    const auto lookAlong = [&](const Vec3d& forward) {
        camera.forwardWorld = forward;
        // Seen from above or below any direction across will do.
        if (glm::length(glm::cross(glm::normalize(forward), glm::normalize(from.up))) < 1e-6)
            camera.upWorld =
                std::abs(forward.y) > 0.9 * glm::length(forward) ? Vec3d(0, 0, 1) : Vec3d(0, 1, 0);
    };
    if (!from.eyeWorld) {
        lookAlong(from.direction);
        double margin = kMargin;
        for (const Effect& effect : scene.effects) margin += effect.marginShare;
        return fitted(camera, boundsWorld, from.isParallel, scene.hasLegend ? legendPixels : 0, margin);
    }
    const Vec3d target = from.targetWorld.value_or(0.5 * (boundsWorld.min + boundsWorld.max));
    if (target == *from.eyeWorld)
        throw InputError(
            "the eye is in the middle of the data, which it would look at: camera.target is missing");
    camera.eyeWorld = *from.eyeWorld;
    camera.heightWorld = from.heightWorld;
    lookAlong(target - *from.eyeWorld);
    viewOf(camera);
    return camera;
}

std::vector<Focus> focusOf(const SceneBricks& bricks, const Box3d& boundsWorld, const Camera& camera,
                           double finestSpacingWorld) {
    const Vec3d size = boundsWorld.size();
    const double usualRadius = std::max({size.x, size.y, size.z}) / kFocusSizes;
    std::vector<Focus> focus;
    for (const SceneFocus& at : bricks.focus)
        focus.push_back(pointFocus(at.placeWorld, at.radiusWorld.value_or(usualRadius)));
    if (bricks.pixelsAVoxel > 0) {
        Camera coarser = camera;
        const double pixels = bricks.pixelsAVoxel;
        coarser.widthPixels = std::max(1, int(std::lround(camera.widthPixels / pixels)));
        coarser.heightPixels = std::max(1, int(std::lround(camera.heightPixels / pixels)));
        focus.push_back(cameraFocus(coarser, finestSpacingWorld));
    }
    if (focus.empty()) focus.push_back(pointFocus(0.5 * (boundsWorld.min + boundsWorld.max), usualRadius));
    return focus;
}

std::array<double, 2> shownRangeOf(const SceneFunction& function, const ValueRange& range) {
    if (!function.stops.empty()) return {function.stops.front().value, function.stops.back().value};
    if (function.range) return *function.range;
    return {range.min, range.max};
}

TransferFunction functionOf(const SceneFunction& function, const ValueRange& range,
                            std::span<const double> histogram) {
    TransferFunction result;
    if (!function.stops.empty()) {
        result.stops = function.stops;
        return result;
    }
    const std::array<double, 2> ends = shownRangeOf(function, range);
    const double low = ends[0], high = ends[1];
    if (function.isLogarithmic && low > 0 && !std::isfinite(high / low))
        throw InputError("a logarithmic scale can't span " + shortNumber(low) + " to " + shortNumber(high));
    if (function.isLogarithmic && !(low > 0))
        throw InputError("a logarithmic scale needs values above 0, and these begin at " +
                         shortNumber(low, 6) + ": give a range");
    const auto opacities = function.opacities.empty() ? opacitiesOf(histogram) : function.opacities;
    const auto add = [&](double share, double opacity) {
        const double value =
            function.isLogarithmic ? low * std::pow(high / low, share) : low + share * (high - low);
        // Rounding must not turn the order of stops that stand close together.
        const double before = result.stops.empty() ? value : result.stops.back().value;
        result.stops.push_back({std::max(value, before), mappedColour(function.map, share), opacity});
    };
    if (!(low < high)) {
        add(0.5, opacityAt(opacities, 0.5));
        return result;
    }
    const int steps = function.isLogarithmic ? kLogarithmicSteps : kSteps;
    std::size_t next = 0;
    for (int step = 0; step <= steps; ++step) {
        const double share = double(step) / steps;
        for (; next < opacities.size() && opacities[next][0] <= share; ++next)
            add(opacities[next][0], opacities[next][1]);
        const bool isThere = next > 0 && opacities[next - 1][0] == share;
        if (!isThere) add(share, opacityAt(opacities, share));
    }
    return result;
}

}  // namespace tessera
