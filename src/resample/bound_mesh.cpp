#include "resample/bound_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"
#include "mesh/sub_mesh.h"

namespace tessera {

namespace {

/// Building an index takes as long as so many passes over the mesh.
constexpr int kPassesBeforeIndex = 6;
/// A pass over the mesh is cheaper than gathering more than this share of it.
constexpr double kLargestShare = 0.25;
/// Boxes that fill more of the mesh's bounds aren't worth an index.
constexpr double kLargestVolumeShare = 0.25;
/// Elements between the points of a box count for so much: they are looked at, but not sampled.
constexpr std::int64_t kLookedAtForOne = 4;
/// Boxes that fill this share of the one around them are looked for as one: bricks side by side.
constexpr double kOneBoxShare = 0.75;

// One that holds them all and little else; an empty one where there is none.
IndexBox joined(std::vector<IndexBox> all) {
    std::erase_if(all, [](const IndexBox& box) { return box.empty(); });
    if (all.empty()) return {};
    // Twins fill nothing more.
    const auto corners = [](const IndexBox& box) {
        return std::array{box.min.x, box.min.y, box.min.z, box.max.x, box.max.y, box.max.z};
    };
    std::ranges::sort(all, {}, corners);
    const auto areTwins = [&](const IndexBox& a, const IndexBox& b) { return corners(a) == corners(b); };
    all.erase(std::unique(all.begin(), all.end(), areTwins), all.end());
    IndexBox around = all.front();
    double points = 0;
    for (const IndexBox& box : all) {
        around.min = glm::min(around.min, box.min);
        around.max = glm::max(around.max, box.max);
        points += double(box.count());
    }
    const Vec3d size = Vec3d(around.max) - Vec3d(around.min);
    return points >= kOneBoxShare * size.x * size.y * size.z ? around : IndexBox{};
}

PointGrid gridOf(const Lattice& lattice) {
    return {lattice.originWorld, {lattice.uWorld.x, lattice.vWorld.y, lattice.wWorld.z}, kNearMarginVoxels};
}

// Appends the elements that can reach points of a box, ascending. Where there are more than points, those
// between the points are left out. Stops when there are more than `most` in the list.
void findNear(const ElementIndex& index, const Lattice& lattice, const IndexBox& box, std::size_t most,
              std::vector<std::int32_t>& elements) {
    const Box3d bounds = boundsWorld(lattice, box, kNearMarginVoxels);
    if (!lattice.isAxisParallel()) return index.query(bounds, elements, most);
    const std::size_t before = elements.size(), many = before + std::size_t(box.count());
    index.query(bounds, elements, many);
    if (elements.size() <= many) return;
    elements.resize(before);
    const PointGrid grid = gridOf(lattice);
    index.query(bounds, elements, most, &grid);
}

}  // namespace

bool areFewNear(const ElementIndex& index, const Lattice& lattice, const IndexBox& box,
                std::int64_t elements) {
    const Box3d bounds = boundsWorld(lattice, box, kNearMarginVoxels);
    const std::int64_t all = index.count(bounds);
    if (all <= elements) return true;
    if (all > kLookedAtForOne * elements || all <= box.count() || !lattice.isAxisParallel()) return false;
    const PointGrid grid = gridOf(lattice);
    return index.count(bounds, &grid) <= elements;
}

Box3d boundsWorld(const Lattice& lattice, const IndexBox& box, double marginVoxels) {
    Box3d bounds;
    if (box.empty()) return bounds;
    const Vec3d low = Vec3d(box.min) - marginVoxels, high = Vec3d(box.max) - 1.0 + marginVoxels;
    for (int corner = 0; corner < 8; ++corner)
        bounds.include(lattice.worldFromIndex(
            {corner & 1 ? high.x : low.x, corner & 2 ? high.y : low.y, corner & 4 ? high.z : low.z}));
    // Far above the rounding of a corner's three products and sums.
    const Vec3d farthest = glm::max(glm::abs(low), glm::abs(high));
    const Vec3d slack =
        0x1p-49 * (glm::abs(lattice.originWorld) + farthest.x * glm::abs(lattice.uWorld) +
                   farthest.y * glm::abs(lattice.vWorld) + farthest.z * glm::abs(lattice.wWorld));
    return {bounds.min - slack, bounds.max + slack};
}

BoundMesh::BoundMesh(const TetMesh& mesh, std::span<const int> fields, const BindOptions& options)
    : fields_(fields.begin(), fields.end()),
      route_(options.route),
      index_(options.index ? options.index : std::make_shared<const SharedElementIndex>(mesh)),
      isShared_(options.index != nullptr) {
    TESSERA_CHECK(&index_->mesh() == &mesh, "the index is of another mesh");
    for (const int f : fields_) TESSERA_CHECK(f >= 0 && std::size_t(f) < mesh.fields.size(), "no such field");
}

double BoundMesh::volumeWorld() const {
    std::call_once(measured_, [&] {
        Box3d bounds;
        for (const Vec3d& point : whole().points) bounds.include(point);
        const Vec3d size = bounds.size();
        volumeWorld_ = bounds.empty() ? 0 : size.x * size.y * size.z;
    });
    return volumeWorld_;
}

bool BoundMesh::wantsIndex(const Lattice& lattice, std::span<const IndexBox> boxes) const {
    if (route_ != Route::automatic) return route_ == Route::index;
    const double voxel = std::abs(glm::dot(lattice.uWorld, glm::cross(lattice.vWorld, lattice.wWorld)));
    double points = 0;
    for (const IndexBox& box : boxes) points += double(box.count());
    if (!(points * voxel <= kLargestVolumeShare * volumeWorld())) return false;
    return isShared_ || index_->ifBuilt() || passes_.fetch_add(1) >= kPassesBeforeIndex;
}

std::optional<std::vector<std::int32_t>> BoundMesh::elementsNear(const Lattice& lattice,
                                                                 std::span<const IndexBox> boxes,
                                                                 const Execution& execution) const {
    if (!wantsIndex(lattice, boxes)) return std::nullopt;
    const ElementIndex& index = index_->get(execution);
    const std::size_t most = route_ == Route::automatic
                                 ? std::size_t(kLargestShare * double(index.elementCount()))
                                 : ElementIndex::kEvery;
    std::vector<std::int32_t> elements;
    if (boxes.size() > 1)
        if (const IndexBox around = joined({boxes.begin(), boxes.end()}); !around.empty()) {
            findNear(index, lattice, around, most, elements);
            if (elements.size() <= most) return elements;
            elements.clear();
        }
    for (const IndexBox& box : boxes) {
        findNear(index, lattice, box, most, elements);
        if (elements.size() > most) return std::nullopt;
    }
    if (boxes.size() > 1) sortEachOnce(elements);
    return elements;
}

TetMesh BoundMesh::part(std::span<const std::int32_t> elements) const {
    return extractElements(whole(), elements, fields_);
}

std::optional<TetMesh> BoundMesh::near(const Lattice& lattice, std::span<const IndexBox> boxes,
                                       const Execution& execution) const {
    const auto elements = elementsNear(lattice, boxes, execution);
    return elements ? std::optional(part(*elements)) : std::nullopt;
}

}  // namespace tessera
