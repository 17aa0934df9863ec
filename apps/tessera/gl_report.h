#pragma once

#include <string>

#include "run_report.h"

namespace tessera {

/// What every OpenGL platform gives on this machine, or why it gives nothing, and which one is taken when
/// none is asked for. Creates contexts when first called.
std::string glText();
Json glJson();

}  // namespace tessera
