#include "base/timer.h"

#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>

namespace tessera {

long long peakMemoryBytes() {
    // getrusage counts what the parent held when it started this process: the file counts this program alone.
    if (std::FILE* file = std::fopen("/proc/self/status", "re")) {
        char line[256];
        long long kilobytes = -1;
        while (kilobytes < 0 && std::fgets(line, sizeof line, file))
            if (std::sscanf(line, "VmHWM: %lld kB", &kilobytes) != 1) kilobytes = -1;
        std::fclose(file);
        if (kilobytes >= 0) return kilobytes * 1024;
    }
    rusage usage{};
    if (getrusage(RUSAGE_SELF, &usage) != 0) return 0;
    return static_cast<long long>(usage.ru_maxrss) * 1024;
}

long long residentMemoryBytes() {
    long long pages = 0;
    if (std::FILE* file = std::fopen("/proc/self/statm", "re")) {
        if (std::fscanf(file, "%*d %lld", &pages) != 1) pages = 0;
        std::fclose(file);
    }
    return pages * ::sysconf(_SC_PAGE_SIZE);
}

}  // namespace tessera
