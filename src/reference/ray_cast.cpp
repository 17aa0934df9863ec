#include "reference/ray_cast.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "refine/camera_view.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Less light than this share can't be seen in a float.
constexpr double kDark = 1e-8;
/// Places are looked up this share of the finest spacing further along the ray, to be beyond a border.
constexpr double kBeyond = 1e-6;

/// Where a ray that is in a box leaves it, in units of `direction` from `from`.
double exitDistance(const Vec3d& from, const Vec3d& direction, const Box3d& box) {
    double exit = std::numeric_limits<double>::infinity();
    for (int a = 0; a < 3; ++a)
        if (direction[a] != 0)
            exit = std::min(exit, ((direction[a] > 0 ? box.max[a] : box.min[a]) - from[a]) / direction[a]);
    return exit;
}

}  // namespace

double ImageDifference::rms(std::int64_t pixels) const {
    return pixels > 0 ? std::sqrt(sumOfSquares / (3 * double(pixels))) : 0;
}

ImageDifference differenceOf(const RgbaImage& a, const RgbaImage& b) {
    if (a.width != b.width || a.height != b.height)
        throw InputError("pictures of different sizes can't be compared");
    ImageDifference difference;
    for (std::size_t p = 0; p < a.pixels.size(); ++p)
        for (std::size_t c = 0; c < 3; ++c) {
            const double d = std::abs(double(a.pixels[p][c]) - double(b.pixels[p][c]));
            difference.sumOfSquares += d * d;
            difference.largest = std::max(difference.largest, d);
        }
    return difference;
}

RayCaster::RayCaster(const BrickTree& tree, const Reconstruction& reconstruction, int channel,
                     const Execution& execution)
    : tree_(tree), bricks_(tree.leafCount()) {
    parallelFor(execution, std::int64_t(tree.leafCount()), [&](std::int64_t leaf) {
        const BrickKey& key = tree.leaves()[std::size_t(leaf)];
        Brick& brick = bricks_[std::size_t(leaf)];
        const IndexBox box = tree.closedPoints(key);
        for (int z = box.min.z; z < box.max.z; ++z)
            for (int y = box.min.y; y < box.max.y; ++y)
                for (int x = box.min.x; x < box.max.x; ++x) {
                    const SeamValue at = reconstruction.at(key.level, {x, y, z}, channel);
                    brick.values.push_back(float(at.value));
                    brick.surface.push_back(at.covered ? 0.5f : -0.5f);
                }
        findRange(brick);
    });
}

RayCaster::RayCaster(const BrickTree& tree, std::vector<BrickPoints> points)
    : tree_(tree), bricks_(tree.leafCount()) {
    for (std::size_t leaf = 0; leaf < bricks_.size(); ++leaf) {
        static_cast<BrickPoints&>(bricks_[leaf]) = std::move(points[leaf]);
        findRange(bricks_[leaf]);
    }
}

void RayCaster::findRange(Brick& brick) const {
    for (const float value : brick.values) {
        if (!std::isfinite(value)) continue;
        brick.range.min = std::min(brick.range.min, double(value));
        brick.range.max = std::max(brick.range.max, double(value));
    }
}

/// How the rays of a picture go through bricks.
struct RayWay {
    const TransferFunction& function;
    const RayCastOptions& options;
    std::vector<bool> isShown;  ///< by leaf
    bool isOutlinedBySamples = false;
    Vec3d forward;
};

/// A ray on its way.
class RayCaster::Ray {
  public:
    Ray(const RayCaster& caster, const RayWay& way, const ViewRay& ray)
        : caster_(caster),
          tree_(caster.tree_),
          way_(way),
          // In index space of level 0, by distances in world units.
          eye_((ray.originWorld - tree_.originWorld()) / tree_.spacingWorld()),
          direction_(ray.direction / tree_.spacingWorld()),
          depthALength_(glm::dot(ray.direction, way.forward)) {}

    void follow(const RaySpan& span) {
        const double beyond = kBeyond * tree_.spacingWorld();
        double at = span.begin;
        while (at < span.end && light_ > kDark) {
            const Vec3d place = eye_ + (at + beyond) * direction_;
            const std::int64_t leaf = tree_.findLeafAt(place);
            if (leaf < 0) {
                at += tree_.spacingWorld() / 2;
                continue;
            }
            const BrickKey& key = tree_.leaves()[std::size_t(leaf)];
            const double edge = std::ldexp(double(tree_.brickCells()), key.level);
            const Vec3d low = Vec3d(key.index) * edge;
            const double exit = exitDistance(eye_, direction_, {low, low + edge});
            const double end = std::min(std::max(exit, at + beyond), span.end);
            if (way_.isShown[std::size_t(leaf)]) pass(std::size_t(leaf), at, end);
            at = end;
        }
    }

    Rgba color() const { return {float(sum_[0]), float(sum_[1]), float(sum_[2]), float(1 - light_)}; }

  private:
    void pass(std::size_t leaf, double begin, double end) {
        const BrickKey& key = tree_.leaves()[leaf];
        const double voxels = std::ldexp(1.0, -key.level);  // for one of level 0
        const Vec3d first = Vec3d(key.index) * double(tree_.brickCells());
        const double spacing = tree_.spacingWorld(key.level);
        const Brick& brick = caster_.bricks_[leaf];
        const auto localAt = [&](double at) { return (eye_ + at * direction_) * voxels - first; };
        const auto coverAt = [&](double at) {
            return way_.isOutlinedBySamples ? surfaceAt(brick, localAt(at)) : 0.5;
        };
        double cover = coverAt(begin);
        // Of a step that the surface runs through the part in the mesh counts, the distance taken as linear.
        const auto step = [&](double from, double to) {
            const double coverNext = coverAt(to);
            const double crossing = from + std::clamp(cover / (cover - coverNext), 0.0, 1.0) * (to - from);
            const bool isInside = std::max(cover, coverNext) >= 0;
            const double in = cover < 0 ? crossing : from, out = coverNext < 0 ? crossing : to;
            cover = coverNext;
            if (isInside && out > in) show(valueAt(brick, localAt(0.5 * (in + out))), out - in);
        };
        if (way_.options.slicesAVoxel > 0) {
            const double slab = spacing / way_.options.slicesAVoxel / depthALength_;
            double from = begin;
            for (double k = std::floor(begin / slab) + 1; from < end && light_ > kDark; ++k) {
                const double to = std::min(k * slab, end);
                if (to > from) step(from, to);
                from = std::max(from, to);
            }
            return;
        }
        const double count = std::max(1.0, std::ceil((end - begin) / (way_.options.stepVoxels * spacing)));
        const double length = (end - begin) / count;
        for (double i = 0; i < count && light_ > kDark; ++i)
            step(begin + i * length, begin + (i + 1) * length);
    }

    template <class At>
    double interpolate(const Vec3d& local, const At& at) const {
        const CellPlace place = locateInBrick(local, tree_.brickCells());
        const std::size_t n = std::size_t(tree_.brickCells()) + 1;
        const std::size_t corner =
            (std::size_t(place.cell.z) * n + std::size_t(place.cell.y)) * n + std::size_t(place.cell.x);
        const Vec3d& t = place.fraction;
        const auto row = [&](std::size_t offset) {
            return glm::mix(double(at(corner + offset)), double(at(corner + offset + 1)), t.x);
        };
        return glm::mix(glm::mix(row(0), row(n), t.y), glm::mix(row(n * n), row(n * n + n), t.y), t.z);
    }
    double surfaceAt(const Brick& brick, const Vec3d& local) const {
        return interpolate(local, [&](std::size_t p) { return brick.surface[p]; });
    }
    double valueAt(const Brick& brick, const Vec3d& local) const {
        return interpolate(local, [&](std::size_t p) { return brick.values[p]; });
    }

    void show(double value, double stepWorld) {
        if (!std::isfinite(value)) return;
        const std::array<double, 4> shown = shownAt(way_.function, value);
        if (!(shown[3] > 0)) return;
        const double passed = std::pow(1 - shown[3], stepWorld / way_.options.layerWorld);
        for (std::size_t c = 0; c < 3; ++c) sum_[c] += light_ * (1 - passed) * shown[c] / shown[3];
        light_ *= passed;
    }

    const RayCaster& caster_;
    const BrickTree& tree_;
    const RayWay& way_;
    Vec3d eye_, direction_;
    double depthALength_;
    std::array<double, 3> sum_{};
    double light_ = 1;
};

template <class SpansOf>
RgbaImage RayCaster::drawAlong(const Camera& camera, const SpansOf& spansOf, bool isOutlinedBySamples,
                               const TransferFunction& function, const RayCastOptions& options,
                               const Execution& execution) const {
    checkTransferFunction(function);
    if (!(options.layerWorld > 0) || !(options.stepVoxels > 0))
        throw InputError("rays need steps and a layer of a length above 0");
    const CameraView view = viewOf(camera);
    RayWay way{function, options, std::vector<bool>(bricks_.size()), isOutlinedBySamples, view.forward};
    for (std::size_t leaf = 0; leaf < bricks_.size(); ++leaf) {
        const ValueRange& range = bricks_[leaf].range;
        way.isShown[leaf] = !range.empty() && showsAny(function, range.min, range.max);
    }
    RgbaImage image{camera.widthPixels, camera.heightPixels, {}};
    image.pixels.resize(std::size_t(image.width) * std::size_t(image.height));
    parallelFor(execution, image.height, [&](std::int64_t y) {
        for (int x = 0; x < image.width; ++x) {
            const ViewRay viewRay = view.rayOf(camera, x, int(y));
            Ray ray(*this, way, viewRay);
            for (const RaySpan& span : spansOf(x, int(y), viewRay)) ray.follow(span);
            image.at(x, int(y)) = ray.color();
        }
    });
    return image;
}

RgbaImage RayCaster::draw(const MeshRays& rays, const TransferFunction& function,
                          const RayCastOptions& options, const Execution& execution) const {
    return drawAlong(
        rays.camera(), [&](int x, int y, const ViewRay&) { return rays.spans(x, y); }, false, function,
        options, execution);
}

RgbaImage RayCaster::draw(const Camera& camera, std::span<const HalfSpace> within,
                          const TransferFunction& function, const RayCastOptions& options,
                          const Execution& execution) const {
    Box3d all;
    for (const BrickKey& key : tree_.leaves()) {
        const double edge = std::ldexp(double(tree_.brickCells()), key.level) * tree_.spacingWorld();
        all.include(tree_.originWorld() + Vec3d(key.index) * edge);
        all.include(tree_.originWorld() + Vec3d(key.index + 1) * edge);
    }
    std::vector<HalfSpace> halves(within.begin(), within.end());
    for (int a = 0; a < 3; ++a) {
        Vec3d axis(0);
        axis[a] = 1;
        halves.push_back({axis, all.min[a]});
        halves.push_back({-axis, -all.max[a]});
    }
    const auto spanOf = [&](int, int, const ViewRay& ray) {
        RaySpan span{0, std::numeric_limits<double>::infinity()};
        for (const HalfSpace& half : halves) {
            const double rise = glm::dot(half.normalWorld, ray.direction);
            const double missing = half.offsetWorld - glm::dot(half.normalWorld, ray.originWorld);
            if (rise == 0 && missing > 0) span.end = -1;
            if (rise > 0) span.begin = std::max(span.begin, missing / rise);
            if (rise < 0) span.end = std::min(span.end, missing / rise);
        }
        return std::array{span};
    };
    return drawAlong(camera, spanOf, true, function, options, execution);
}

}  // namespace tessera
