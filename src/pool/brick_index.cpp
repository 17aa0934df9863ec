#include "pool/brick_index.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "base/check.h"
#include "base/floor_div.h"

namespace tessera {

namespace {

/// Cells of the grid, at most, or four for each root where that is more.
constexpr double kFewCells = 4096;

Vec3i shifted(const Vec3i& index, int right) {
    // Arithmetic shifts round towards minus infinity.
    return {index.x >> right, index.y >> right, index.z >> right};
}

}  // namespace

BrickIndex::BrickIndex() {
    layOut({});
}

void BrickIndex::set(std::size_t word, std::uint32_t value) {
    words_[word] = value;
    const auto run = std::uint32_t(word / kRunWords);
    if (isChanged_[run]) return;
    isChanged_[run] = true;
    changedRuns_.push_back(run);
}

std::vector<std::uint32_t> BrickIndex::takeChangedRuns() {
    for (const std::uint32_t run : changedRuns_) isChanged_[run] = false;
    return std::exchange(changedRuns_, {});
}

bool BrickIndex::holds(const Vec3i& root) const {
    for (int a = 0; a < 3; ++a)
        if (root[a] < rootMin_[a] || root[a] >= rootMax_[a]) return false;
    return true;
}

void BrickIndex::cover(std::span<const Vec3i> roots) {
    if (std::all_of(roots.begin(), roots.end(), [&](const Vec3i& root) { return holds(root); })) return;
    if (rootMin_ == rootMax_) rootMin_ = roots.front(), rootMax_ = roots.front() + 1;
    for (const Vec3i& root : roots)
        rootMin_ = glm::min(rootMin_, root), rootMax_ = glm::max(rootMax_, root + 1);
    rootCount_ = std::max(rootCount_, roots.size());

    std::vector<std::pair<DepthKey, std::uint32_t>> leaves;
    Vec3i cell;
    for (cell.z = 0; cell.z < gridSize_.z; ++cell.z)
        for (cell.y = 0; cell.y < gridSize_.y; ++cell.y)
            for (cell.x = 0; cell.x < gridSize_.x; ++cell.x) {
                const int word = (cell.z * gridSize_.y + cell.y) * gridSize_.x + cell.x;
                collect(words_[kHeaderWords + std::size_t(word)], {Depth(-lift_), gridMin_ + cell}, leaves);
            }
    layOut(std::move(leaves));
}

void BrickIndex::collect(std::uint32_t entry, const DepthKey& key,
                         std::vector<std::pair<DepthKey, std::uint32_t>>& leaves) const {
    if (kindOf(entry) == leaf) leaves.emplace_back(key, entry >> 2);
    if (kindOf(entry) != split) return;
    for (unsigned child = 0; child < 8; ++child)
        collect(words_[childWord(entry >> 2, child)], childKey(key, child), leaves);
}

// Chooses the grid for the roots covered and puts the leaves into it.
void BrickIndex::layOut(std::vector<std::pair<DepthKey, std::uint32_t>> leaves) {
    const double most = std::max(kFewCells, 4.0 * double(rootCount_));
    for (lift_ = 0;; ++lift_) {
        gridMin_ = shifted(rootMin_, lift_);
        gridSize_ = shifted(rootMax_ - 1, lift_) - gridMin_ + 1;
        if (rootMin_ == rootMax_) gridSize_ = Vec3i(0);
        if (double(gridSize_.x) * gridSize_.y * gridSize_.z <= most) break;
    }
    firstNode_ = std::uint32_t(gridSize_.x * gridSize_.y * gridSize_.z);
    words_.assign(kHeaderWords + firstNode_, 0);
    freeNodes_.clear();
    isChanged_.assign(words_.size() / kRunWords + 1, false);
    changedRuns_.clear();
    for (std::size_t word = 0; word < words_.size(); word += kRunWords) set(word, 0);
    for (int a = 0; a < 3; ++a) {
        set(std::size_t(a), std::uint32_t(gridMin_[a]));
        set(std::size_t(4 + a), std::uint32_t(gridSize_[a]));
    }
    set(3, std::uint32_t(lift_));
    set(7, firstNode_);
    for (const auto& [key, number] : leaves) put(key, number);
}

std::size_t BrickIndex::cellWord(const DepthKey& key) const {
    const Vec3i cell = shifted(key.index, std::min(key.depth.halvings() + lift_, 31)) - gridMin_;
    for (int a = 0; a < 3; ++a)
        if (cell[a] < 0 || cell[a] >= gridSize_[a]) return 0;
    return kHeaderWords + std::size_t((cell.z * gridSize_.y + cell.y) * gridSize_.x + cell.x);
}

unsigned BrickIndex::childOn(const DepthKey& key, int at) {
    return childNumber(shifted(key.index, std::min(key.depth.halvings() - at - 1, 31)));
}

std::uint32_t BrickIndex::takeNode() {
    if (!freeNodes_.empty()) {
        const std::uint32_t node = freeNodes_.back();
        freeNodes_.pop_back();
        return node;
    }
    const std::size_t words = words_.size();
    words_.resize(words + 8, 0);
    isChanged_.resize(words_.size() / kRunWords + 1, false);
    for (std::size_t word = words; word < words_.size(); ++word) set(word, 0);
    return std::uint32_t((words - kHeaderWords - firstNode_) / 8);
}

void BrickIndex::put(const DepthKey& key, std::uint32_t number) {
    TESSERA_CHECK(number < kMostNumbers, "too large a number");
    std::size_t word = cellWord(key);
    TESSERA_CHECK(word != 0, "no root of the index");
    for (int at = -lift_; at < key.depth.halvings(); ++at) {
        TESSERA_CHECK(kindOf(words_[word]) != leaf, "a leaf stands above");
        if (kindOf(words_[word]) == absent) {
            const std::uint32_t node = takeNode();
            set(word, node << 2 | split);
        }
        word = childWord(words_[word] >> 2, childOn(key, at));
    }
    TESSERA_CHECK(kindOf(words_[word]) != split, "leaves stand below");
    set(word, number << 2 | leaf);
}

void BrickIndex::remove(const DepthKey& key) {
    std::array<std::size_t, 64> path;
    std::size_t length = 0;
    std::size_t word = cellWord(key);
    for (int at = -lift_; word != 0 && at < key.depth.halvings(); ++at) {
        path[length++] = word;
        word = kindOf(words_[word]) == split ? childWord(words_[word] >> 2, childOn(key, at)) : 0;
    }
    TESSERA_CHECK(word != 0 && kindOf(words_[word]) == leaf, "no leaf of the index");
    set(word, 0);
    // Nodes that are empty now go.
    while (length > 0) {
        const std::uint32_t node = words_[path[--length]] >> 2;
        for (unsigned child = 0; child < 8; ++child)
            if (words_[childWord(node, child)] != 0) return;
        freeNodes_.push_back(node);
        set(path[length], 0);
    }
}

std::optional<BrickIndex::Found> BrickIndex::findCovering(const DepthKey& key) const {
    const std::size_t cell = cellWord(key);
    if (cell == 0) return std::nullopt;
    std::uint32_t entry = words_[cell];
    for (int at = -lift_; at <= key.depth.halvings(); ++at) {
        if (kindOf(entry) == leaf) return Found{ancestorKey(key, Depth(at)), entry >> 2};
        if (kindOf(entry) == absent || at == key.depth.halvings()) break;
        entry = words_[childWord(entry >> 2, childOn(key, at))];
    }
    return std::nullopt;
}

std::optional<BrickIndex::Found> BrickIndex::findOwner(Depth depth, const Vec3i& p, int cells) const {
    // The brick of the asked depth; of the depth reached, below it.
    DepthKey key{depth, floorDiv(p, cells)};
    Vec3i rest = p - key.index * cells;
    const std::size_t cell = cellWord(key);
    if (cell == 0) return std::nullopt;
    std::uint32_t entry = words_[cell];
    for (int at = -lift_; kindOf(entry) != absent; ++at) {
        if (kindOf(entry) == leaf) return Found{ancestorKey(key, Depth(at)), entry >> 2};
        unsigned child = 0;
        if (at < depth.halvings()) {
            child = childOn(key, at);
        } else {
            rest *= 2;
            for (int a = 0; a < 3; ++a)
                if (rest[a] >= cells) child |= 1u << a, rest[a] -= cells;
            key = childKey(key, child);
        }
        entry = words_[childWord(entry >> 2, child)];
    }
    return std::nullopt;
}

}  // namespace tessera
