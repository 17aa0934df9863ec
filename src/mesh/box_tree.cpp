#include "mesh/box_tree.h"

#include <algorithm>
#include <limits>

#include "base/parallel.h"

namespace tessera {

namespace {

constexpr std::int64_t kTreeChunk = 1 << 14;

/// Below this many items one task sorts a whole subtree.
constexpr std::int64_t kTaskItems = 1 << 14;

/// An item at the middle of its box.
struct Item {
    Vec3d centre;
    std::int32_t index;
};

/// Puts the items that belong before `middle` in front of it: those with the smaller centre along the longest
/// side of all centres. Ties go by index, so the result is one and the same.
void partitionAt(std::span<Item> items, std::int64_t middle) {
    if (middle <= 0 || middle >= std::int64_t(items.size())) return;
    Box3d centres;
    for (const Item& item : items) centres.include(item.centre);
    const Vec3d size = centres.size();
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    std::nth_element(
        items.begin(), items.begin() + middle, items.end(), [axis](const Item& a, const Item& b) {
            return a.centre[axis] != b.centre[axis] ? a.centre[axis] < b.centre[axis] : a.index < b.index;
        });
}

/// Splits a node of `span` places, 4 to the power of its level, into its four children.
void splitNode(std::span<Item> items, std::int64_t childSpan) {
    const auto count = std::int64_t(items.size());
    const std::int64_t half = std::min(2 * childSpan, count);
    partitionAt(items, half);
    partitionAt(items.first(std::size_t(half)), childSpan);
    if (count > half) partitionAt(items.subspan(std::size_t(half)), childSpan);
}

void sortSubtree(std::span<Item> items, std::int64_t span) {
    for (std::int64_t child = span / BoxTree::kWidth; child >= 1; child /= BoxTree::kWidth)
        for (std::int64_t at = 0; at < std::int64_t(items.size()); at += child * BoxTree::kWidth) {
            const std::int64_t length = std::min(child * BoxTree::kWidth, std::int64_t(items.size()) - at);
            splitNode(items.subspan(std::size_t(at), std::size_t(length)), child);
        }
}

/// Orders the items so that every node of the tree, 4^level places in a row, is a compact group.
void sortItems(std::vector<Item>& items, const Execution& execution) {
    const auto count = std::int64_t(items.size());
    std::int64_t span = 1;
    while (span < count) span *= BoxTree::kWidth;
    const std::span<Item> all(items);
    const auto part = [&](std::int64_t node) {
        return all.subspan(std::size_t(node * span), std::size_t(std::min(span, count - node * span)));
    };
    for (; span > kTaskItems; span /= BoxTree::kWidth)
        parallelFor(execution, (count + span - 1) / span,
                    [&](std::int64_t node) { splitNode(part(node), span / BoxTree::kWidth); });
    parallelFor(execution, (count + span - 1) / span,
                [&](std::int64_t node) { sortSubtree(part(node), span); });
}

BoxTree::Node emptyNode() {
    BoxTree::Node node;
    for (auto& axis : node.min) axis.fill(std::numeric_limits<double>::infinity());
    for (auto& axis : node.max) axis.fill(-std::numeric_limits<double>::infinity());
    return node;
}

void setChild(BoxTree::Node& node, std::size_t c, const Box3d& box) {
    for (int k = 0; k < 3; ++k) {
        node.min[std::size_t(k)][c] = box.min[k];
        node.max[std::size_t(k)][c] = box.max[k];
    }
}

Box3d boundsOf(const BoxTree::Node& node) {
    Box3d box;
    for (int k = 0; k < 3; ++k) {
        box.min[k] = *std::min_element(node.min[std::size_t(k)].begin(), node.min[std::size_t(k)].end());
        box.max[k] = *std::max_element(node.max[std::size_t(k)].begin(), node.max[std::size_t(k)].end());
    }
    return box;
}

/// One level of nodes over `count` children; boxOf(i) gives the box of child i.
template <class BoxOf>
std::vector<BoxTree::Node> buildLevel(std::int64_t count, const Execution& execution, const BoxOf& boxOf) {
    const std::int64_t nodes = (count + BoxTree::kWidth - 1) / BoxTree::kWidth;
    std::vector<BoxTree::Node> level{std::size_t(nodes)};
    parallelForChunks(execution, nodes, kTreeChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t n = begin; n < end; ++n) {
            BoxTree::Node node = emptyNode();
            for (std::int64_t c = 0; c < BoxTree::kWidth && n * BoxTree::kWidth + c < count; ++c)
                setChild(node, std::size_t(c), boxOf(n * BoxTree::kWidth + c));
            level[std::size_t(n)] = node;
        }
    });
    return level;
}

}  // namespace

BoxTree::BoxTree(std::span<const Box3d> boxes, const Execution& execution) {
    if (boxes.empty()) return;
    const auto count = std::int64_t(boxes.size());
    std::vector<Item> items(boxes.size());
    parallelForChunks(execution, count, kTreeChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            const Box3d& box = boxes[std::size_t(i)];
            items[std::size_t(i)] = {box.min + 0.5 * (box.max - box.min), std::int32_t(i)};
        }
    });
    sortItems(items, execution);
    order_.resize(boxes.size());
    for (std::size_t i = 0; i < items.size(); ++i) order_[i] = items[i].index;

    levels_.push_back(buildLevel(count, execution, [&](std::int64_t place) {
        return boxes[std::size_t(order_[std::size_t(place)])];
    }));
    while (levels_.back().size() > 1) {
        const std::vector<Node>& below = levels_.back();
        auto level = buildLevel(std::int64_t(below.size()), execution,
                                [&](std::int64_t n) { return boundsOf(below[std::size_t(n)]); });
        levels_.push_back(std::move(level));
    }
}

}  // namespace tessera
