#include "brick/brick_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/check.h"

namespace tessera {

std::size_t BrickKeyHash::operator()(const BrickKey& key) const {
    // Multiplicative mixing of the four integers; the last shift brings the high bits down to where tables
    // look.
    std::uint64_t h = std::uint64_t(std::uint32_t(key.level)) * 0x9e3779b97f4a7c15ull;
    for (const int v : {key.index.x, key.index.y, key.index.z})
        h = (h ^ std::uint64_t(std::uint32_t(v))) * 0x9fb21c651e98df25ull, h ^= h >> 29;
    return std::size_t(h ^ (h >> 32));
}

namespace {

// Arithmetic shifts round towards minus infinity, as floor division by a power of two does.
Vec3i ancestorIndex(const Vec3i& index, int levels) {
    if (levels > 31) levels = 31;
    return {index.x >> levels, index.y >> levels, index.z >> levels};
}

}  // namespace

BrickTree::BrickTree(const Vec3d& originWorld, double spacingWorld, int brickCells,
                     std::vector<BrickKey> leaves)
    : origin_(originWorld), spacing_(spacingWorld), brickCells_(brickCells), leaves_(std::move(leaves)) {
    TESSERA_CHECK(brickCells > 0 && std::has_single_bit(unsigned(brickCells)),
                  "a brick has a power of two of cells");
    TESSERA_CHECK(spacingWorld > 0, "a brick tree needs a spacing");
    std::sort(leaves_.begin(), leaves_.end(), inStorageOrder);
    if (leaves_.empty()) return;
    TESSERA_CHECK(leaves_.front().level >= 0, "levels count from 0");
    levelCount_ = leaves_.back().level + 1;
    layOutRoots();
    for (std::size_t i = 0; i < leaves_.size(); ++i) insert(std::int32_t(i));
}

void BrickTree::layOutRoots() {
    Vec3i last{0};
    bool first = true;
    for (const BrickKey& key : leaves_) {
        const Vec3i root = ancestorIndex(key.index, levelCount_ - 1 - key.level);
        rootMin_ = first ? root : glm::min(rootMin_, root);
        last = first ? root : glm::max(last, root);
        first = false;
    }
    rootSize_ = last - rootMin_ + 1;
    const double cells = double(rootSize_.x) * double(rootSize_.y) * double(rootSize_.z);
    if (cells <= std::max(65536.0, 16.0 * double(leaves_.size())))
        denseRoots_.assign(std::size_t(cells), kAbsent);
    else
        rootSize_ = Vec3i(0);
}

std::int32_t BrickTree::sparseRootEntry(const Vec3i& index) const {
    const auto found = sparseRoots_.find(BrickKey{0, index});
    return found == sparseRoots_.end() ? kAbsent : found->second;
}

std::int32_t& BrickTree::rootSlot(const Vec3i& index) {
    if (denseRoots_.empty()) return sparseRoots_.try_emplace(BrickKey{0, index}, kAbsent).first->second;
    const Vec3i q = index - rootMin_;
    return denseRoots_[(std::size_t(q.z) * std::size_t(rootSize_.y) + std::size_t(q.y)) *
                           std::size_t(rootSize_.x) +
                       std::size_t(q.x)];
}

void BrickTree::insert(std::int32_t leaf) {
    const BrickKey& key = leaves_[std::size_t(leaf)];
    int level = levelCount_ - 1;
    std::int32_t* slot = &rootSlot(ancestorIndex(key.index, level - key.level));
    while (level > key.level) {
        TESSERA_CHECK(*slot < 0, "a leaf brick lies inside another");
        std::size_t position = inner_.size();
        if (*slot == kAbsent) {
            *slot = innerEntry(position);
            inner_.emplace_back().fill(kAbsent);
        } else {
            position = innerPosition(*slot);
        }
        --level;
        slot = &inner_[position][childOf(ancestorIndex(key.index, level - key.level))];
    }
    TESSERA_CHECK(*slot == kAbsent, "two leaf bricks overlap");
    *slot = leaf;
}

double BrickTree::spacingWorld(int level) const {
    return std::ldexp(spacing_, level);
}

Lattice BrickTree::lattice(int level) const {
    return Lattice::axisParallel(origin_, spacingWorld(level));
}

IndexBox BrickTree::ownedPoints(const BrickKey& key) const {
    return {key.index * brickCells_, key.index * brickCells_ + brickCells_};
}

IndexBox BrickTree::closedPoints(const BrickKey& key) const {
    return {key.index * brickCells_, key.index * brickCells_ + (brickCells_ + 1)};
}

std::int32_t BrickTree::descend(const BrickKey& key, int& level) const {
    level = levelCount_ - 1;
    if (key.level > level || key.level < 0) return kAbsent;
    std::int32_t entry = rootEntry(ancestorIndex(key.index, level - key.level));
    while (level > key.level && entry < kAbsent) {
        --level;
        entry = inner_[innerPosition(entry)][childOf(ancestorIndex(key.index, level - key.level))];
    }
    return entry;
}

BrickTree::Walk BrickTree::walk() const {
    // Positions of entries are 32 bits too.
    if (denseRoots_.empty() || inner_.size() > std::size_t(1) << 27) return {};
    const std::int32_t* children = inner_.empty() ? nullptr : inner_.front().data();
    return {denseRoots_.data(), children, rootMin_, rootSize_, rootShift()};
}

std::int64_t BrickTree::findLeaf(const BrickKey& key) const {
    int level = 0;
    const std::int32_t entry = descend(key, level);
    return entry >= 0 && level == key.level ? entry : -1;
}

std::int64_t BrickTree::findCovering(const BrickKey& key) const {
    int level = 0;
    const std::int32_t entry = descend(key, level);
    return entry >= 0 ? entry : -1;
}

bool BrickTree::isRefined(const BrickKey& key) const {
    if (key.level >= levelCount_)
        return std::any_of(leaves_.begin(), leaves_.end(), [&](const BrickKey& leaf) {
            return ancestorIndex(leaf.index, key.level - leaf.level) == key.index;
        });
    int level = 0;
    return descend(key, level) < kAbsent;
}

void BrickTree::findIn(std::int32_t entry, int level, const Vec3i& index, const Box3d& index0,
                       std::vector<std::size_t>& leaves) const {
    if (entry == kAbsent) return;
    const double size = std::ldexp(double(brickCells_), level);
    const Vec3d low = Vec3d(index) * size;
    for (int a = 0; a < 3; ++a)
        if (index0.max[a] < low[a] || index0.min[a] >= low[a] + size) return;
    if (entry >= 0) {
        leaves.push_back(std::size_t(entry));
        return;
    }
    const Children& children = inner_[innerPosition(entry)];
    for (int c = 0; c < 8; ++c)
        findIn(children[std::size_t(c)], level - 1, index * 2 + Vec3i(c & 1, (c >> 1) & 1, c >> 2), index0,
               leaves);
}

void BrickTree::findLeavesIn(const Box3d& index0, std::vector<std::size_t>& leaves) const {
    if (levelCount_ == 0 || index0.empty()) return;
    const int level = levelCount_ - 1;
    if (denseRoots_.empty()) {
        for (const auto& [key, entry] : sparseRoots_) findIn(entry, level, key.index, index0, leaves);
        return;
    }
    const double size = std::ldexp(double(brickCells_), level);
    const Vec3d first(rootMin_), last(rootMin_ + rootSize_ - 1);
    const Vec3i low(glm::clamp(glm::floor(index0.min / size), first, last));
    const Vec3i high(glm::clamp(glm::floor(index0.max / size), first, last));
    for (int z = low.z; z <= high.z; ++z)
        for (int y = low.y; y <= high.y; ++y)
            for (int x = low.x; x <= high.x; ++x)
                findIn(rootEntry({x, y, z}), level, {x, y, z}, index0, leaves);
}

std::int64_t BrickTree::findLeafAt(int level, const Vec3i& p) const {
    if (levelCount_ == 0) return -1;
    // 64 bits: a coarse lattice's far corner, counted in points of level 0, may pass 2^31.
    const std::int64_t x = std::int64_t(p.x) << level, y = std::int64_t(p.y) << level,
                       z = std::int64_t(p.z) << level;
    return findLeafBy([&](int shift) { return Vec3i(int(x >> shift), int(y >> shift), int(z >> shift)); });
}

}  // namespace tessera
