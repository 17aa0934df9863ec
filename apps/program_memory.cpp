// Linked to programs, which then allocate by mimalloc, in large pages where the system has them: memory that
// is written to for the first time costs far less. Such pages are kept until the program ends, and each takes
// milliseconds at once: with TESSERA_SMALL_PAGES there are none. mimalloc's own operators can't throw and end
// the program.

#include <mimalloc.h>

#include <cstddef>
#include <cstdio>
#include <new>

namespace {

#ifndef TESSERA_SMALL_PAGES
// Of a number in a file of /proc; it may not be there.
bool isZero(const char* path) {
    std::FILE* file = std::fopen(path, "r");
    if (!file) return true;
    const int first = std::fgetc(file);
    std::fclose(file);
    return first == '0';
}

// Not where pages are reserved for programs that ask for them, which mimalloc would do: a container may be
// refused them when they are written to, and ends. The environment's MIMALLOC_LARGE_OS_PAGES comes before it.
[[gnu::constructor]] void preferLargePages() {
    if (isZero("/proc/sys/vm/nr_hugepages") && isZero("/proc/sys/vm/nr_overcommit_hugepages"))
        mi_option_set_enabled_default(mi_option_large_os_pages, true);
}
#endif

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

// All ways to give back; mimalloc knows sizes and alignments by itself.
void operator delete(void* memory) noexcept {
    mi_free(memory);
}
void operator delete[](void* memory) noexcept {
    mi_free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
    mi_free(memory);
}
void operator delete[](void* memory, std::size_t) noexcept {
    mi_free(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept {
    mi_free(memory);
}
void operator delete[](void* memory, std::align_val_t) noexcept {
    mi_free(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
    mi_free(memory);
}
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept {
    mi_free(memory);
}
void operator delete(void* memory, const std::nothrow_t&) noexcept {
    mi_free(memory);
}
void operator delete[](void* memory, const std::nothrow_t&) noexcept {
    mi_free(memory);
}
void operator delete(void* memory, std::align_val_t, const std::nothrow_t&) noexcept {
    mi_free(memory);
}
void operator delete[](void* memory, std::align_val_t, const std::nothrow_t&) noexcept {
    mi_free(memory);
}
