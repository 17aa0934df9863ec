#pragma once

// TESSERA_ADDRESS_SANITIZER, TESSERA_THREAD_SANITIZER: defined where the compiler, GCC or clang, puts that
// sanitizer into the code. With this file included, ask by #ifdef, or by the constants below.

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define TESSERA_ADDRESS_SANITIZER
#endif
#if __has_feature(thread_sanitizer)
#define TESSERA_THREAD_SANITIZER
#endif
#endif

#if defined(__SANITIZE_ADDRESS__) && !defined(TESSERA_ADDRESS_SANITIZER)
#define TESSERA_ADDRESS_SANITIZER
#endif
#if defined(__SANITIZE_THREAD__) && !defined(TESSERA_THREAD_SANITIZER)
#define TESSERA_THREAD_SANITIZER
#endif

namespace tessera {

#ifdef TESSERA_ADDRESS_SANITIZER
inline constexpr bool kIsAddressSanitized = true;
#else
inline constexpr bool kIsAddressSanitized = false;
#endif
#ifdef TESSERA_THREAD_SANITIZER
inline constexpr bool kIsThreadSanitized = true;
#else
inline constexpr bool kIsThreadSanitized = false;
#endif
/// All is many times slower then.
inline constexpr bool kIsSanitized = kIsAddressSanitized || kIsThreadSanitized;

}  // namespace tessera
