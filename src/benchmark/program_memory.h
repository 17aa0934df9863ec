#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "benchmark/brick_cases.h"
#include "tessera/execution.h"

namespace tessera {

/// Largest memory of `tessera resample` of that file with a case's lattice and algorithm, from reading to
/// writing, as it reports it; none where it fails. @param program tessera itself. @param field of the file.
std::optional<std::int64_t> peakMemoryOfProgram(const std::string& program, const std::string& meshPath,
                                                const Field& field, const BrickCase& bricks,
                                                const Execution& execution);

}  // namespace tessera
