#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "index_space/exact_scan.h"

namespace tessera {

using ScanFunction = void (*)(const ScanInput&, const ScanOutput&, std::span<const std::int32_t> elements,
                              ScanCounts&);

/// A compiled version of the scan for one instruction set.
struct ScanTarget {
    std::string name;
    ScanFunction scan;
};
/// Those that this processor can run, the fastest first. All give the same bits.
const std::vector<ScanTarget>& scanTargets();

}  // namespace tessera
