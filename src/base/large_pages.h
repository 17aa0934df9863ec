#pragma once

#include <cstddef>
#include <vector>

namespace tessera {

/// Asks for large pages of memory that nothing was written to yet. Places that are reached in no order then
/// cost fewer address translations, and the first touch is cheaper. Does nothing for memory that holds none,
/// and where the system has none.
void preferLargePages(void* memory, std::size_t bytes);

/// Room for `count` items, in large pages where that helps. For arrays of megabytes.
template <class Item>
void reserveLarge(std::vector<Item>& items, std::size_t count) {
    if (count <= items.capacity()) return;
    items.reserve(count);
    preferLargePages(items.data() + items.size(), (items.capacity() - items.size()) * sizeof(Item));
}

/// The same, and so many items in it.
template <class Item>
void resizeLarge(std::vector<Item>& items, std::size_t count) {
    reserveLarge(items, count);
    items.resize(count);
}

}  // namespace tessera
