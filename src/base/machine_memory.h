#pragma once

#include <cstdint>
#include <string>

namespace tessera {

/// Bytes of memory that this process and others can have: the machine's, or less where a control group of it
/// (a container, a service) bounds it. The largest number where nothing is known.
std::int64_t machineMemoryBytes();

/// Three quarters of it: what a run takes where nobody says how much it may.
std::int64_t defaultMemoryBytes();

/// What this process holds now, of what it shares with others its part; all of that where the system doesn't
/// tell the part, and 0 where it tells nothing.
std::int64_t heldMemoryBytes();

/// The least bound on memory of a process's control groups and of those above them, of version 1 and 2; the
/// largest number where there is none.
/// @param groups text of /proc/self/cgroup. @param mount where groups are mounted: /sys/fs/cgroup.
std::int64_t groupMemoryBytes(const std::string& groups, const std::string& mount);

}  // namespace tessera
