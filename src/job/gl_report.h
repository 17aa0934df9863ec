#pragma once

#include <string>

#include "job/run_report.h"

namespace tessera {

/// What every OpenGL platform gives on this machine, or why it gives nothing, and which one is taken when
/// none is asked for. Creates contexts when first called.
/// @param width columns that tables keep to.
std::string glText(std::size_t width);
Json glJson();

}  // namespace tessera
