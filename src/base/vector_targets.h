#pragma once

#include "base/sanitizers.h"

// To be included before <hwy/foreach_target.h>: the instruction sets that Highway doesn't compile for. Each
// costs its compile time; under a sanitizer two have to do.
#if defined(TESSERA_ADDRESS_SANITIZER) || defined(TESSERA_THREAD_SANITIZER)
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3 | HWY_AVX3_DL)
#else
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#endif
