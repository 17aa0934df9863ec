#include "reference/ray_cast.h"

#include <algorithm>
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

bool showsAny(const TransferFunction& function, const ValueRange& range) {
    if (range.empty()) return false;
    if (shownAt(function, range.min)[3] > 0 || shownAt(function, range.max)[3] > 0) return true;
    return std::any_of(function.stops.begin(), function.stops.end(), [&](const TransferFunction::Stop& stop) {
        return stop.opacity > 0 && stop.value >= range.min && stop.value <= range.max;
    });
}

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
        const IndexBox box = tree.closedPoints(key);
        Brick& brick = bricks_[std::size_t(leaf)];
        brick.values.reserve(std::size_t(box.count()));
        for (int z = box.min.z; z < box.max.z; ++z)
            for (int y = box.min.y; y < box.max.y; ++y)
                for (int x = box.min.x; x < box.max.x; ++x) {
                    const float value = float(reconstruction.at(key.level, {x, y, z}, channel).value);
                    brick.values.push_back(value);
                    if (!std::isfinite(value)) continue;
                    brick.range.min = std::min(brick.range.min, double(value));
                    brick.range.max = std::max(brick.range.max, double(value));
                }
    });
}

/// A ray on its way.
class RayCaster::Ray {
  public:
    Ray(const RayCaster& caster, const TransferFunction& function, const RayCastOptions& options,
        const std::vector<bool>& isShown, const Vec3d& eyeWorld, const Vec3d& direction)
        : caster_(caster),
          tree_(caster.tree_),
          function_(function),
          options_(options),
          isShown_(isShown),
          // In index space of level 0, by distances in world units.
          eye_((eyeWorld - tree_.originWorld()) / tree_.spacingWorld()),
          direction_(direction / tree_.spacingWorld()) {}

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
            if (isShown_[std::size_t(leaf)]) pass(std::size_t(leaf), at, end);
            at = end;
        }
    }

    Rgba color() const { return {float(sum_[0]), float(sum_[1]), float(sum_[2]), float(1 - light_)}; }

  private:
    void pass(std::size_t leaf, double begin, double end) {
        const BrickKey& key = tree_.leaves()[leaf];
        const double voxels = std::ldexp(1.0, -key.level);  // for one of level 0
        const Vec3d first = Vec3d(key.index) * double(tree_.brickCells());
        const double longest = options_.stepVoxels * tree_.spacingWorld(key.level);
        const double count = std::max(1.0, std::ceil((end - begin) / longest));
        const double step = (end - begin) / count;
        const Brick& brick = caster_.bricks_[leaf];
        for (double i = 0.5; i < count && light_ > kDark; ++i)
            add(valueAt(brick, (eye_ + (begin + i * step) * direction_) * voxels - first), step);
    }

    double valueAt(const Brick& brick, const Vec3d& local) const {
        const CellPlace place = locateInBrick(local, tree_.brickCells());
        const std::size_t n = std::size_t(tree_.brickCells()) + 1;
        const std::size_t corner =
            (std::size_t(place.cell.z) * n + std::size_t(place.cell.y)) * n + std::size_t(place.cell.x);
        const float* const v = brick.values.data() + corner;
        const Vec3d& t = place.fraction;
        const auto row = [&](std::size_t offset) {
            return glm::mix(double(v[offset]), double(v[offset + 1]), t.x);
        };
        return glm::mix(glm::mix(row(0), row(n), t.y), glm::mix(row(n * n), row(n * n + n), t.y), t.z);
    }

    void add(double value, double stepWorld) {
        if (!std::isfinite(value)) return;
        const std::array<double, 4> shown = shownAt(function_, value);
        if (!(shown[3] > 0)) return;
        const double passed = std::pow(1 - shown[3], stepWorld / options_.layerWorld);
        for (std::size_t c = 0; c < 3; ++c) sum_[c] += light_ * (1 - passed) * shown[c] / shown[3];
        light_ *= passed;
    }

    const RayCaster& caster_;
    const BrickTree& tree_;
    const TransferFunction& function_;
    const RayCastOptions& options_;
    const std::vector<bool>& isShown_;
    Vec3d eye_, direction_;
    std::array<double, 3> sum_{};
    double light_ = 1;
};

RgbaImage RayCaster::draw(const MeshRays& rays, const TransferFunction& function,
                          const RayCastOptions& options, const Execution& execution) const {
    checkTransferFunction(function);
    if (!(options.layerWorld > 0) || !(options.stepVoxels > 0))
        throw InputError("rays need steps and a layer of a length above 0");
    std::vector<bool> isShown(bricks_.size());
    for (std::size_t leaf = 0; leaf < bricks_.size(); ++leaf)
        isShown[leaf] = showsAny(function, bricks_[leaf].range);
    const Camera& camera = rays.camera();
    const CameraView view = viewOf(camera);
    RgbaImage image{camera.widthPixels, camera.heightPixels, {}};
    image.pixels.resize(std::size_t(image.width) * std::size_t(image.height));
    parallelFor(execution, image.height, [&](std::int64_t y) {
        for (int x = 0; x < image.width; ++x) {
            Ray ray(*this, function, options, isShown, camera.eyeWorld, view.directionOf(camera, x, int(y)));
            for (const RaySpan& span : rays.spans(x, int(y))) ray.follow(span);
            image.pixels[std::size_t(y) * std::size_t(image.width) + std::size_t(x)] = ray.color();
        }
    });
    return image;
}

}  // namespace tessera
