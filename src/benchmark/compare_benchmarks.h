#pragma once

#include <string>

#include "job/run_report.h"

namespace tessera {

/// A benchmark's document from a report.json. Throws InputError when it isn't one.
Json readBenchmark(const std::string& path);

/// What got faster or slower from one document to another, beyond what differs between runs of one build.
Json compareBenchmarks(const Json& earlier, const Json& later);

}  // namespace tessera
