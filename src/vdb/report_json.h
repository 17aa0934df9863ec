#pragma once

#include <string>

#include "tessera/report.h"

namespace tessera {

/// The report as JSON text. Numbers are written so that they read back to the same double; a value that isn't
/// finite is null. The schema is in docs/vdb_layout.md, "Error report".
std::string reportToJson(const ErrorReport& report);

/// Throws InputError when the text isn't JSON of this schema.
ErrorReport reportFromJson(const std::string& text);

}  // namespace tessera
