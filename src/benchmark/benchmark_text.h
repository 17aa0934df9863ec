#pragma once

#include <string>

#include "job/run_report.h"

namespace tessera {

/// The benchmark's document as tables for a terminal. @param width columns that tables keep to.
std::string benchmarkText(const Json& document, std::size_t width);

}  // namespace tessera
