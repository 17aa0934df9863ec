#include "base/machine_memory.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <limits>
#include <sstream>

#include "base/timer.h"

namespace tessera {

namespace {

constexpr std::int64_t kNoBound = std::numeric_limits<std::int64_t>::max();

/// "max" stands for none.
std::int64_t numberIn(const std::string& path) {
    std::ifstream file(path);
    std::int64_t bytes = 0;
    return file >> bytes && bytes > 0 ? bytes : kNoBound;
}

/// Of a group and all above it. In a container the path may be one outside, which isn't there: what is
/// mounted is then its own group.
std::int64_t leastBound(const std::string& mount, std::string path, const std::string& file) {
    std::int64_t least = numberIn(mount + "/" + file);
    while (path.size() > 1) {
        least = std::min(least, numberIn(mount + path + "/" + file));
        path.resize(path.rfind('/'));
    }
    return least;
}

}  // namespace

std::int64_t groupMemoryBytes(const std::string& groups, const std::string& mount) {
    std::int64_t least = kNoBound;
    std::istringstream lines(groups);
    for (std::string line; std::getline(lines, line);) {
        // number:controllers:/path
        const std::size_t first = line.find(':'), second = line.find(':', first + 1);
        if (second == std::string::npos || line.compare(second + 1, 1, "/") != 0) continue;
        const std::string path = line.substr(second + 1);
        line[first] = ',';
        if (second == first + 1)
            least = std::min(least, leastBound(mount, path, "memory.max"));
        else if (line.substr(first, second - first).append(",").find(",memory,") != std::string::npos)
            least = std::min(least, leastBound(mount + "/memory", path, "memory.limit_in_bytes"));
    }
    return least;
}

std::int64_t machineMemoryBytes() {
    const long pages = ::sysconf(_SC_PHYS_PAGES), pageBytes = ::sysconf(_SC_PAGE_SIZE);
    const std::int64_t machine = pages > 0 && pageBytes > 0 ? std::int64_t(pages) * pageBytes : kNoBound;
    std::ifstream file("/proc/self/cgroup");
    const std::string groups{std::istreambuf_iterator<char>(file), {}};
    return std::min(machine, groupMemoryBytes(groups, "/sys/fs/cgroup"));
}

std::int64_t heldMemoryBytes() {
    std::ifstream file("/proc/self/smaps_rollup");
    for (std::string line; std::getline(file, line);)
        if (line.starts_with("Pss:")) return std::stoll(line.substr(4)) * 1024;
    return residentMemoryBytes();
}

std::int64_t defaultMemoryBytes() {
    return machineMemoryBytes() / 4 * 3;
}

}  // namespace tessera
