#include "resample/cut_plane.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/text.h"
#include "mesh/sub_mesh.h"
#include "resample/check_lattice.h"
#include "tessera/error.h"
#include "tessera/lattice.h"

namespace tessera {

namespace {

constexpr int kTilePixels = 2048;   // along the edge of one block: bounds the memory of blocks in flight
constexpr double kSnap = 1e-6;      // share of a pixel by which a picture may be short of covering the cut
constexpr double kPoint = 0x1p-40;  // a cut smaller than this share of the mesh is a point

bool isFinite(const Vec3d& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Of length 1. An axis comes out exactly, and no component overflows on the way.
Vec3d direction(const Vec3d& v) {
    const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    const Vec3d scaled = v / largest;
    return scaled / glm::length(scaled) + 0.0;  // + 0: no negative zeros
}

struct CutAxes {
    Vec3d right, up, normal;
};

CutAxes cutAxes(const CutOptions& options) {
    if (!isFinite(options.normal)) throw InputError("the cut's normal must be finite");
    if (options.normal == Vec3d(0)) throw InputError("the cut's normal must not be zero");
    CutAxes axes;
    const Vec3d n = axes.normal = direction(options.normal);
    const Vec3d size = glm::abs(n);
    const bool alongZ = size.z >= size.x && size.z >= size.y;
    const Vec3d usualUp = alongZ ? Vec3d(0, 1, 0) : Vec3d(0, 0, 1);
    const int rightAxis = !alongZ && size.x > size.y ? 1 : 0;
    axes.up = direction(usualUp - n * glm::dot(n, usualUp));
    axes.right = direction(glm::cross(axes.up, n));
    const double side = axes.right[rightAxis] < 0 ? -1 : 1;
    axes.right = side * axes.right + 0.0;
    if (!options.up) return axes;
    if (!isFinite(*options.up) || *options.up == Vec3d(0))
        throw InputError("the cut's upward direction must be finite and not zero");
    const Vec3d up = direction(*options.up);
    const Vec3d inPlane = up - n * glm::dot(n, up);
    if (glm::length(inPlane) < 1e-6) throw InputError("the cut's upward direction must not be its normal");
    axes.up = direction(inPlane);
    axes.right = side * direction(glm::cross(axes.up, n)) + 0.0;
    return axes;
}

/// Square pixels over an extent in the plane, the picture's centre on the extent's.
CutFrame frameOver(const Box3d& extent, const CutAxes& axes, const Vec3d& origin, int resolution) {
    const Vec3d size = extent.size();
    const double pixel = std::max(size.x, size.y) / resolution;
    checkSpacing(pixel);
    const auto count = [&](double length) {
        return std::clamp(int(std::ceil(length / pixel - kSnap)), 1, resolution);
    };
    CutFrame frame;
    frame.width = count(size.x);
    frame.height = count(size.y);
    const Vec3d middle = extent.min + 0.5 * size;
    const double left = middle.x - 0.5 * (frame.width - 1) * pixel;
    const double bottom = middle.y - 0.5 * (frame.height - 1) * pixel;
    frame.lattice.originWorld = origin + left * axes.right + bottom * axes.up;
    frame.lattice.uWorld = pixel * axes.right;
    frame.lattice.vWorld = pixel * axes.up;
    frame.lattice.wWorld = pixel * axes.normal;
    return frame;
}

}  // namespace

void checkCutOptions(const CutOptions& options) {
    if (options.originWorld && !isFinite(*options.originWorld))
        throw InputError("the cut's origin must be finite");
    if (options.resolution < 1 || options.resolution > kLargestCutResolution)
        throw InputError("a cut has 1 to " + std::to_string(kLargestCutResolution) +
                         " pixels along its longer edge, not " + std::to_string(options.resolution));
    if (options.sizeWorld)
        for (const double length : *options.sizeWorld)
            if (!(std::isfinite(length) && length > 0))
                throw InputError("the cut's size must be finite and above 0");
    cutAxes(options);
}

Cut planCut(const TetMesh& mesh, const PlaneQuery& query, const CutOptions& options) {
    checkCutOptions(options);
    const CutAxes axes = cutAxes(options);
    const Box3d& bounds = query.boundsWorld();
    if (bounds.empty()) throw InputError("the mesh has no element to cut");
    const Vec3d boundsSize = bounds.size();
    const double diagonal = std::hypot(boundsSize.x, boundsSize.y, boundsSize.z);
    if (!std::isfinite(diagonal)) checkSpacing(diagonal);
    // Twice the bound: the lattice's own points lie off the plane by their rounding.
    const double padPixels = 2 * options.spillVoxels;

    Cut cut;
    cut.normal = axes.normal;
    cut.originWorld = options.originWorld.value_or(bounds.min + 0.5 * bounds.size());
    PlanePatch patch{cut.originWorld, {axes.right, axes.up, axes.normal}, {}};
    if (options.sizeWorld) {
        const auto [width, height] = *options.sizeWorld;
        const Vec3d half = 0.5 * Vec3d(width, height, 0);
        cut.frame = frameOver({-half, half}, axes, cut.originWorld, options.resolution);
        patch.halfWorld = half + padPixels * cut.frame.spacingWorld();
    } else {
        const double infinity = std::numeric_limits<double>::infinity();
        patch.halfWorld = {infinity, infinity, padPixels * diagonal / options.resolution};
    }
    cut.hits = query.find(patch);
    const Box3d extent = cutExtent(mesh, cut.hits.elements, patch);
    if (extent.empty())
        throw InputError("the " + std::string(options.sizeWorld ? "picture around " : "plane through ") +
                         placeText(cut.originWorld) + " with normal " + placeText(cut.normal) +
                         " misses the mesh, which lies between " + placeText(bounds.min) + " and " +
                         placeText(bounds.max));
    if (options.sizeWorld) return cut;
    const Vec3d size = extent.size();
    if (!(std::max(size.x, size.y) > kPoint * diagonal))
        throw InputError("the plane through " + placeText(cut.originWorld) + " with normal " +
                         placeText(cut.normal) + " meets the mesh in a single point");
    cut.frame = frameOver(extent, axes, cut.originWorld, options.resolution);
    return cut;
}

CutSamples sampleCut(const TetMesh& mesh, const Cut& cut, std::span<const int> fields,
                     const Resampler& resampler, const BindOptions& options, const Execution& execution) {
    const TetMesh part = extractElements(mesh, cut.hits.elements, fields);
    std::vector<int> partFields;
    std::size_t channels = 0;
    for (const Field& field : part.fields) {
        partFields.push_back(int(partFields.size()));
        channels += std::size_t(field.components);
    }
    const CutFrame& frame = cut.frame;
    CutSamples samples;
    samples.width = frame.width;
    samples.height = frame.height;
    const std::size_t pixels = std::size_t(frame.width) * std::size_t(frame.height);
    samples.channels.assign(channels, std::vector<float>(pixels, 0.0f));
    samples.coverage.assign(pixels, 0);

    std::vector<IndexBox> tiles;
    for (int y = 0; y < frame.height; y += kTilePixels)
        for (int x = 0; x < frame.width; x += kTilePixels)
            tiles.push_back(
                {{x, y, 0},
                 {std::min(x + kTilePixels, frame.width), std::min(y + kTilePixels, frame.height), 1}});
    const auto bound = resampler.bind(part, partFields, options);
    samples.target = bound->target();
    const auto keep = [&](std::size_t, const Block& block) {
        const Vec3i size = block.box.size();
        for (int j = 0; j < size.y; ++j) {
            const std::size_t from = std::size_t(j) * std::size_t(size.x);
            const std::size_t to =
                std::size_t(frame.height - 1 - block.box.min.y - j) * std::size_t(frame.width) +
                std::size_t(block.box.min.x);
            for (std::size_t i = 0; i < std::size_t(size.x); ++i) {
                if (!block.coverage[from + i]) continue;
                samples.coverage[to + i] = 1;
                for (std::size_t c = 0; c < channels; ++c)
                    samples.channels[c][to + i] = block.channel(int(c))[from + i];
            }
        }
    };
    samples.statistics = bound->resample(frame.lattice, tiles, keep, execution);
    return samples;
}

}  // namespace tessera
