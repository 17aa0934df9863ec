// Linked to programs, which then allocate by mimalloc, in large pages where the system has them: memory that
// is written to for the first time costs far less. Its own operators can't throw and end the program.

#include <mimalloc.h>

#include <cstddef>
#include <new>

namespace {

// The environment's MIMALLOC_LARGE_OS_PAGES comes before it.
[[gnu::constructor]] void preferLargePages() {
    mi_option_set_enabled_default(mi_option_large_os_pages, true);
}

template <class Allocate>
void* allocateOrThrow(const Allocate& allocate) {
    while (true) {
        if (void* memory = allocate()) return memory;
        const std::new_handler handler = std::get_new_handler();
        if (!handler) throw std::bad_alloc();
        handler();
    }
}

void* allocate(std::size_t bytes) {
    return allocateOrThrow([&] { return mi_malloc(bytes); });
}

void* allocate(std::size_t bytes, std::align_val_t alignment) {
    return allocateOrThrow([&] { return mi_malloc_aligned(bytes, std::size_t(alignment)); });
}

}  // namespace

void* operator new(std::size_t bytes) {
    return allocate(bytes);
}
void* operator new[](std::size_t bytes) {
    return allocate(bytes);
}
void* operator new(std::size_t bytes, std::align_val_t alignment) {
    return allocate(bytes, alignment);
}
void* operator new[](std::size_t bytes, std::align_val_t alignment) {
    return allocate(bytes, alignment);
}
void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept {
    return mi_malloc(bytes);
}
void* operator new[](std::size_t bytes, const std::nothrow_t&) noexcept {
    return mi_malloc(bytes);
}
void* operator new(std::size_t bytes, std::align_val_t alignment, const std::nothrow_t&) noexcept {
    return mi_malloc_aligned(bytes, std::size_t(alignment));
}
void* operator new[](std::size_t bytes, std::align_val_t alignment, const std::nothrow_t&) noexcept {
    return mi_malloc_aligned(bytes, std::size_t(alignment));
}
