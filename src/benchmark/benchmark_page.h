#pragma once

#include <string>

#include "job/run_report.h"

namespace tessera {

std::string benchmarkPage(const Json& document);

}  // namespace tessera
