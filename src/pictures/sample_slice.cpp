#include "pictures/sample_slice.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/parallel.h"
#include "pictures/image.h"
#include "tessera/error.h"
#include "tessera/lattice.h"

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

SliceFrame sliceFrame(const BrickTree& tree, const SliceOptions& options) {
    if (options.axis < 0 || options.axis > 2) throw InputError("a slice's axis is 0, 1 or 2");
    if (options.pixels < 1 || options.pixels > 16384)
        throw InputError("a slice has 1 to 16384 pixels along its longer edge");
    const Box3d bounds = options.boundsWorld.empty() ? boundsOf(tree) : options.boundsWorld;
    if (bounds.empty()) throw InputError("there are no bricks to slice");
    const int right = options.axis == 0 ? 1 : 0, up = options.axis == 2 ? 1 : 2;
    const double width = bounds.size()[right], height = bounds.size()[up];
    if (!(width > 0 && height > 0)) throw InputError("a slice needs bounds with an area");
    const double pixelWorld = std::max(width, height) / options.pixels;
    SliceFrame frame;
    frame.width = std::clamp(int(std::lround(width / pixelWorld)), 1, options.pixels);
    frame.height = std::clamp(int(std::lround(height / pixelWorld)), 1, options.pixels);
    Vec3d corner = bounds.min;
    corner[right] += 0.5 * pixelWorld;
    corner[up] += 0.5 * pixelWorld;
    corner[options.axis] = options.positionWorld;
    frame.lattice = {corner, Vec3d(0), Vec3d(0), Vec3d(0)};
    frame.lattice.uWorld[right] = pixelWorld;
    frame.lattice.vWorld[up] = pixelWorld;
    frame.lattice.wWorld[options.axis] = pixelWorld;
    return frame;
}

ScalarImage sampleSlice(const BrickTree& tree, const Reconstruction& reconstruction, int channel,
                        const SliceOptions& options, const Execution& execution) {
    const SliceFrame frame = sliceFrame(tree, options);
    ScalarImage image;
    image.width = frame.width;
    image.height = frame.height;
    TESSERA_CHECK(options.coverage.empty() ||
                      options.coverage.size() == std::size_t(frame.width) * std::size_t(frame.height),
                  "a slice's coverage has one entry a pixel");
    const std::size_t pixels = std::size_t(image.width) * std::size_t(image.height);
    image.values.assign(pixels, 0.0f);
    image.coverage.assign(pixels, 0);
    std::vector<std::int64_t> leafOf(pixels, -1);
    parallelFor(execution, image.height, [&](std::int64_t row) {
        for (int x = 0; x < image.width; ++x) {
            const std::size_t i = image.offset(x, int(row));
            const int up = image.height - 1 - int(row);
            const Vec3d place = frame.lattice.worldFromIndex({double(x), double(up), 0.0});
            const Vec3d index0 = (place - tree.originWorld()) / tree.spacingWorld(0);
            const std::int64_t leaf = tree.findLeafAt(index0);
            const BrickTree* outlined = options.outlined;
            leafOf[i] =
                outlined ? outlined->findLeafAt((place - outlined->originWorld()) / outlined->spacingWorld(0))
                         : leaf;
            if (leaf < 0) continue;
            const int level = tree.leaves()[std::size_t(leaf)].level;
            const Vec3d index = index0 * std::ldexp(1.0, -level);
            const bool inMesh =
                options.coverage.empty()
                    ? reconstruction.isCovered(level, Vec3i(glm::floor(index + 0.5)))
                    : options.coverage[std::size_t(up) * std::size_t(image.width) + std::size_t(x)] != 0;
            if (!inMesh) continue;
            image.values[i] = float(reconstruction.interpolate(std::size_t(leaf), index, channel));
            image.coverage[i] = 1;
        }
    });
    if (options.outlines) markOutlines(image, leafOf);
    return image;
}

}  // namespace tessera
