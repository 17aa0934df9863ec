#include "refine/plan_frame.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <string>
#include <vector>

#include "base/machine_memory.h"
#include "base/parallel.h"
#include "base/text.h"
#include "refine/node_set.h"
#include "refine/refine_options.h"
#include "refine/wishes.h"
#include "resample/check_lattice.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr double kMaxIndex = 1 << 29;  // of level 0; resamplers take indices up to 2^30
constexpr int kDefaultUniformResolution = 256;
constexpr int kDefaultLevels = 8;
constexpr std::int64_t kBoundsChunk = 16384;

bool finite(const Vec3d& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

double longestSide(const Box3d& box) {
    const Vec3d size = box.size();
    return std::max({size.x, size.y, size.z});
}

// Largest |index| of the box along any axis.
double farthestIndex(const Box3d& box, const Vec3d& origin, double spacing) {
    const Vec3d far = glm::max(glm::abs(box.min - origin), glm::abs(box.max - origin)) / spacing;
    return std::max({far.x, far.y, far.z});
}

int rootPoints(int brickCells) {
    return brickCells == 8 ? 32 : 64;
}

double finestSpacing(const RefineOptions& options, double longest) {
    if (options.frame) return options.frame->spacingWorld;
    if (options.spacingWorld > 0) return options.spacingWorld;
    const int points = options.resolution > 0 ? options.resolution : kDefaultUniformResolution;
    return longest / (points - 1);
}

/// A box of nodes, and for each of its six sides a node on it.
struct Extent {
    Box3d box;
    std::array<std::int32_t, 6> node{-1, -1, -1, -1, -1, -1};  // at the lower ends, then at the upper ones
    void include(const Vec3d& point, std::int32_t n) {
        for (int a = 0; a < 3; ++a) {
            lower(a, point[a], n);
            raise(a, point[a], n);
        }
    }
    void include(const Extent& other) {
        for (int a = 0; a < 3; ++a) {
            lower(a, other.box.min[a], other.node[std::size_t(a)]);
            raise(a, other.box.max[a], other.node[std::size_t(a + 3)]);
        }
    }

  private:
    void lower(int axis, double value, std::int32_t n) {
        if (!(value < box.min[axis])) return;
        box.min[axis] = value;
        node[std::size_t(axis)] = n;
    }
    void raise(int axis, double value, std::int32_t n) {
        if (!(value > box.max[axis])) return;
        box.max[axis] = value;
        node[std::size_t(axis + 3)] = n;
    }
};

template <class Counts>
Extent extentOf(const TetMesh& mesh, const Execution& execution, const Counts& counts) {
    std::vector<Extent> parts(std::size_t((mesh.nodeCount() + kBoundsChunk - 1) / kBoundsChunk));
    parallelForChunks(execution, mesh.nodeCount(), kBoundsChunk, [&](std::int64_t begin, std::int64_t end) {
        Extent part;
        for (std::int64_t n = begin; n < end; ++n)
            if (counts(std::size_t(n))) part.include(mesh.points[std::size_t(n)], std::int32_t(n));
        parts[std::size_t(begin / kBoundsChunk)] = part;
    });
    Extent all;
    for (const Extent& part : parts) all.include(part);
    return all;
}

bool elementsUse(const std::array<std::int32_t, 6>& nodes, const TetMesh& mesh, const Execution& execution) {
    std::array<bool, 256> isCandidate{};  // by the last bits: a table that stays in the nearest cache
    for (const std::int32_t n : nodes) isCandidate[std::size_t(n) & 255] = true;
    constexpr unsigned kAll = 63;
    std::atomic<unsigned> used{0};
    parallelForChunks(execution, mesh.elementCount(), kBoundsChunk,
                      [&](std::int64_t begin, std::int64_t end) {
                          if (used.load(std::memory_order_relaxed) == kAll) return;
                          unsigned found = 0;
                          for (std::int64_t e = begin; e < end; ++e)
                              for (const std::int32_t n : mesh.tets[std::size_t(e)]) {
                                  if (!isCandidate[std::size_t(n) & 255]) continue;
                                  for (std::size_t side = 0; side < 6; ++side)
                                      if (nodes[side] == n) found |= 1u << side;
                              }
                          used.fetch_or(found, std::memory_order_relaxed);
                      });
    return used == kAll;
}

}  // namespace

Box3d meshBounds(const TetMesh& mesh, const Execution& execution, const ElementIndex* index) {
    if (index) return index->boundsWorld();
    // Nodes that no element uses don't count; there hardly ever are any.
    const Extent all = extentOf(mesh, execution, [](std::size_t) { return true; });
    if (elementsUse(all.node, mesh, execution)) return all.box;
    const NodeSet used = usedNodes(mesh, execution);
    return extentOf(mesh, execution, [&](std::size_t n) { return used.contains(n); }).box;
}

void checkOptions(const TetMesh& mesh, const Box3d& meshBox, const RefineOptions& options) {
    const auto require = [](bool condition, const std::string& message) {
        if (!condition) throw InputError(message);
    };
    require(mesh.elementCount() > 0, "the mesh has no elements");
    const int b = options.brickCells;
    require(b == 8 || b == 16 || b == 32 || b == 64,
            "the brick size must be 8, 16, 32 or 64, not " + std::to_string(b));
    require(options.resolution == 0 || options.resolution >= 2,
            "the resolution must be at least 2 points, not " + std::to_string(options.resolution));
    require(std::isfinite(options.spacingWorld) && options.spacingWorld >= 0,
            "the spacing must be positive, not " + shortNumber(options.spacingWorld, 6));
    require(options.resolution == 0 || options.spacingWorld == 0, "give a resolution or a spacing, not both");
    require(std::isfinite(options.samplesPerElement) && options.samplesPerElement > 0,
            "samples per element must be positive, not " + shortNumber(options.samplesPerElement, 6));
    require(options.maxLevels >= 0,
            "the number of levels must be at least 1, not " + std::to_string(options.maxLevels));
    require(options.maxVoxels >= 0 && options.maxMemoryBytes >= 0,
            "bounds on voxels and memory must be positive");
    if (options.criterion.has(Criterion::error))
        require(std::isfinite(options.maxError) && options.maxError > 0,
                "the error bound must be positive, not " + shortNumber(options.maxError, 6));
    if (options.criterion.has(Criterion::focus)) {
        require(!options.focus.empty(), "refinement around a focus needs a place");
        checkFocus(options.focus);
    }
    if (options.criterion.has(Criterion::visibility)) {
        require(options.transferFunction.has_value(), "refinement by visibility needs a transfer function");
        checkTransferFunction(*options.transferFunction);
        require(
            !options.criterion.isOnly(Criterion::visibility) && !options.criterion.has(Criterion::uniform),
            "visibility goes with error, element-size or focus: it says where those count");
    }
    require(!options.criterion.has(Criterion::uniform) || options.criterion.isOnly(Criterion::uniform),
            "a uniform spacing goes with no other criterion");
    if (options.frame)
        require(finite(options.frame->originWorld) && std::isfinite(options.frame->spacingWorld) &&
                    options.frame->spacingWorld > 0,
                "the given lattice's spacing must be positive and finite");
    require(longestSide(meshBox) > 0, "the mesh has no extent: all nodes coincide");
    if (options.boundsWorld) {
        const Box3d& box = *options.boundsWorld;
        require(finite(box.min) && finite(box.max) && !box.empty() && longestSide(box) > 0,
                "the bounds must be a box with min below max");
        Box3d common{glm::max(box.min, meshBox.min), glm::min(box.max, meshBox.max)};
        require(!common.empty(), "the bounds do not meet the mesh");
    }
}

double focusSpacing(const Box3d& meshBox, const RefineOptions& options) {
    return finestSpacing(options, longestSide(options.boundsWorld ? *options.boundsWorld : meshBox));
}

PlanFrame chooseFrame(const Box3d& meshBox, const RefineOptions& options) {
    const Box3d box = options.boundsWorld ? *options.boundsWorld : meshBox;
    const Box3d sampled{glm::max(box.min, meshBox.min), glm::min(box.max, meshBox.max)};
    const double longest = longestSide(box);
    const double rootCells = rootPoints(options.brickCells) - 1;

    PlanFrame frame;
    frame.brickCells = options.brickCells;
    frame.boundsWorld = options.boundsWorld;
    frame.meshBoundsWorld = meshBox;
    frame.originWorld = options.frame ? options.frame->originWorld : box.min;
    const Criteria criteria = options.criterion.without(Criterion::visibility);
    const int levels = options.maxLevels > 0 ? options.maxLevels
                       : criteria.has(Criterion::elementSize) && !criteria.has(Criterion::error)
                           ? kDefaultLevels
                           : 31;
    if (criteria.isOnly(Criterion::uniform) || criteria.isOnly(Criterion::focus) ||
        hasFinestSpacing(options)) {
        const double finest = finestSpacing(options, longest);
        checkSpacing(finest);
        const double far = farthestIndex(sampled, frame.originWorld, finest);
        if (!(far < kMaxIndex))
            throw InputError("a spacing of " + shortNumber(finest, 6) + " makes " + shortNumber(far, 6) +
                             " lattice points along an axis, more than 2^29; the finest that fits is " +
                             shortNumber(finest * far / kMaxIndex * 1.01, 6));
        int depth = 0;
        if (!criteria.has(Criterion::uniform))
            while (depth + 1 < levels && longest / std::ldexp(finest, depth + 1) >= rootCells) ++depth;
        frame.rootSpacingWorld = std::ldexp(finest, depth);
        frame.maxDepth = Depth(depth);
        return frame;
    }
    frame.rootSpacingWorld = longest / rootCells;
    // A box to look at closely needn't hold many elements: refinement by error starts from few points there.
    if (options.boundsWorld && criteria.isOnly(Criterion::error) && options.maxLevels == 0)
        while (frame.rootSpacingWorld * options.brickCells < longest) frame.rootSpacingWorld *= 2;
    checkSpacing(frame.rootSpacingWorld);
    const double far = std::max(1.0, farthestIndex(sampled, frame.originWorld, frame.rootSpacingWorld));
    int depth = 0;
    while (depth + 1 < levels && std::ldexp(far, depth + 1) < kMaxIndex &&
           isPossibleSpacing(std::ldexp(frame.rootSpacingWorld, -(depth + 1))))
        ++depth;
    frame.maxDepth = Depth(depth);
    return frame;
}

std::int64_t expectedPoints(const TetMesh& mesh, const Box3d& meshBox, const RefineOptions& options) {
    const Box3d box = options.boundsWorld ? *options.boundsWorld : meshBox;
    const Box3d sampled{glm::max(box.min, meshBox.min), glm::min(box.max, meshBox.max)};
    const Vec3d edges = sampled.size() / focusSpacing(meshBox, options) + 1.0;
    double points = edges.x * edges.y * edges.z;
    if (!options.criterion.has(Criterion::uniform))
        points = std::min(points, double(mesh.elementCount()) * std::pow(options.samplesPerElement, 3));
    const double most = double(leafBudget(options, 1)) * std::pow(double(options.brickCells), 3);
    points = std::min(points, most);
    return points > 1 ? std::int64_t(points) : 1;
}

std::size_t leafBudget(const RefineOptions& options, int channels) {
    const double bytesPerPoint = 4.0 * channels + 0.125;
    double points = 2147483648.0;
    if (options.maxVoxels > 0) {
        points = double(options.maxVoxels);
    } else {
        points = std::min(points, double(machineMemoryBytes()) / 4 / bytesPerPoint);
    }
    const std::int64_t bytes =
        options.maxMemoryBytes > 0 ? options.maxMemoryBytes : options.defaultMemoryBytes;
    if (bytes > 0) points = std::min(points, double(bytes) / bytesPerPoint);
    const double brickPoints = double(options.brickCells) * options.brickCells * options.brickCells;
    return std::size_t(points / brickPoints);
}

}  // namespace tessera
