#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/image.h"

namespace tessera {
namespace {

Box3d boundsOf(const BrickTree& tree) {
    Box3d box;
    for (const BrickKey& key : tree.leaves()) {
        const IndexBox points = tree.closedPoints(key);
        const Lattice lattice = tree.lattice(key.level);
        box.include(lattice.worldFromIndex(Vec3d(points.min)));
        box.include(lattice.worldFromIndex(Vec3d(points.max - Vec3i(1))));
    }
    return box;
}

// The picture's frame: which axes it shows, its lower left corner and the edge of a pixel.
struct Frame {
    int right = 0, up = 1;
    Vec3d corner{0};
    double pixelWorld = 1;
};

void markOutlines(ScalarImage& image, const std::vector<std::int64_t>& leafOf) {
    image.outlines.assign(leafOf.size(), 0);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const std::size_t i = image.offset(x, y);
            const bool left = x > 0 && leafOf[i] != leafOf[image.offset(x - 1, y)];
            const bool above = y > 0 && leafOf[i] != leafOf[image.offset(x, y - 1)];
            image.outlines[i] = left || above;
        }
}

}  // namespace

ScalarImage sampleSlice(const BrickTree& tree, const Reconstruction& reconstruction, int channel,
                        const SliceOptions& options, const Execution& execution) {
    if (options.axis < 0 || options.axis > 2) throw InputError("a slice's axis is 0, 1 or 2");
    if (options.pixels < 1 || options.pixels > 16384)
        throw InputError("a slice has 1 to 16384 pixels along its longer edge");
    const Box3d bounds = options.boundsWorld.empty() ? boundsOf(tree) : options.boundsWorld;
    if (bounds.empty()) throw InputError("there are no bricks to slice");
    Frame frame;
    frame.right = options.axis == 0 ? 1 : 0;
    frame.up = options.axis == 2 ? 1 : 2;
    const double width = bounds.size()[frame.right], height = bounds.size()[frame.up];
    if (!(width > 0 && height > 0)) throw InputError("a slice needs bounds with an area");
    frame.pixelWorld = std::max(width, height) / options.pixels;
    frame.corner = bounds.min;
    frame.corner[options.axis] = options.positionWorld;

    ScalarImage image;
    image.width = std::clamp(int(std::lround(width / frame.pixelWorld)), 1, options.pixels);
    image.height = std::clamp(int(std::lround(height / frame.pixelWorld)), 1, options.pixels);
    const std::size_t pixels = std::size_t(image.width) * std::size_t(image.height);
    image.values.assign(pixels, 0.0f);
    image.coverage.assign(pixels, 0);
    std::vector<std::int64_t> leafOf(pixels, -1);
    parallelFor(execution, image.height, [&](std::int64_t row) {
        for (int x = 0; x < image.width; ++x) {
            const std::size_t i = image.offset(x, int(row));
            Vec3d place = frame.corner;
            place[frame.right] += (x + 0.5) * frame.pixelWorld;
            place[frame.up] += (image.height - 1 - double(row) + 0.5) * frame.pixelWorld;
            const Vec3d index0 = (place - tree.originWorld()) / tree.spacingWorld(0);
            const std::int64_t leaf = tree.findLeafAt(index0);
            leafOf[i] = leaf;
            if (leaf < 0) continue;
            const int level = tree.leaves()[std::size_t(leaf)].level;
            const Vec3d index = index0 * std::ldexp(1.0, -level);
            const Vec3i nearest(glm::floor(index + 0.5));
            if (!reconstruction.resolve(level, nearest, channel, {})) continue;
            image.values[i] = float(reconstruction.interpolate(std::size_t(leaf), index, channel));
            image.coverage[i] = 1;
        }
    });
    if (options.outlines) markOutlines(image, leafOf);
    return image;
}

}  // namespace tessera
