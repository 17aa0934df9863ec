#pragma once

#include <span>
#include <string>

#include "benchmark/benchmark_variants.h"
#include "job/run_report.h"

namespace tessera {

/// Processor, memory, system, compiler, commit, date, and the OpenGL driver where some variant uses one.
/// What isn't known is null.
Json machineJson(int threads, std::span<const BenchmarkVariant> variants, const BindOptions& bind);

}  // namespace tessera
