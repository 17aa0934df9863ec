#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace tessera {

/// Leaves items that nobody gives a value as they are: whoever writes them first touches their memory, and
/// several threads can.
template <class Item>
struct UninitializedAllocator : std::allocator<Item> {
    UninitializedAllocator() = default;
    template <class Other>
    UninitializedAllocator(const UninitializedAllocator<Other>& other) : std::allocator<Item>(other) {}
    template <class Other>
    struct rebind {
        using other = UninitializedAllocator<Other>;
    };
    template <class Constructed, class... Arguments>
    void construct(Constructed* item, Arguments&&... arguments) {
        if constexpr (sizeof...(Arguments) == 0)
            ::new (static_cast<void*>(item)) Constructed;
        else
            ::new (static_cast<void*>(item)) Constructed(std::forward<Arguments>(arguments)...);
    }
};
/// A vector whose resize() gives no values to new items of plain types.
template <class Item>
using UninitializedVector = std::vector<Item, UninitializedAllocator<Item>>;

/// Asks for large pages of memory that nothing was written to yet. Places that are reached in no order then
/// cost fewer address translations, and the first touch is cheaper. Does nothing for memory that holds none,
/// and where the system has none.
void preferLargePages(void* memory, std::size_t bytes);

/// Room for `count` items, in large pages where that helps. For arrays of megabytes.
template <class Item, class Allocator>
void reserveLarge(std::vector<Item, Allocator>& items, std::size_t count) {
    if (count <= items.capacity()) return;
    items.reserve(count);
    preferLargePages(items.data() + items.size(), (items.capacity() - items.size()) * sizeof(Item));
}

/// The same, and so many items in it.
template <class Item, class Allocator>
void resizeLarge(std::vector<Item, Allocator>& items, std::size_t count) {
    reserveLarge(items, count);
    items.resize(count);
}

}  // namespace tessera
