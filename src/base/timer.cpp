#include "base/timer.h"

#include <sys/resource.h>

namespace tessera {

long long peakMemoryBytes() {
    rusage usage{};
    if (getrusage(RUSAGE_SELF, &usage) != 0) return 0;
    return static_cast<long long>(usage.ru_maxrss) * 1024;
}

}  // namespace tessera
