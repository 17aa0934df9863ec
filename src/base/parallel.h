#pragma once

#include <cstdint>
#include <functional>

#include "tessera/execution.h"

namespace tessera {

/// Calls body(i) once for every i in [0, count), in any order, on any thread. The first exception stops the
/// loop and is rethrown. Checks for cancellation between items.
void parallelFor(const Execution& execution, std::int64_t count,
                 const std::function<void(std::int64_t)>& body);

/// Calls body(begin, end) on fixed chunks of `chunk` items of [0, count): chunk borders, and so any per-chunk
/// result, do not depend on the number of threads.
void parallelForChunks(const Execution& execution, std::int64_t count, std::int64_t chunk,
                       const std::function<void(std::int64_t, std::int64_t)>& body);

}  // namespace tessera
