#pragma once

#include <string>

#include "tessera/transfer_function.h"

namespace tessera {

/// Reads a transfer function from JSON:
///
///     {"field": "Density", "stops": [{"value": 0.2, "color": [1, 0.5, 0], "opacity": 0.3}, ...]}
///
/// "field" and "color" (white) may be left out. Throws InputError with the file and the place in it for
/// anything else that is missing, wrong or unknown.
TransferFunction readTransferFunction(const std::string& path);

}  // namespace tessera
