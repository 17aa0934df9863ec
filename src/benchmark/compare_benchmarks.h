#pragma once

#include <string>

#include "job/run_report.h"

namespace tessera {

/// A benchmark's document from a report.json. Throws InputError when it isn't one.
Json readBenchmark(const std::string& path);

/// Throws InputError where two documents are of different meshes or fields, or have different threads: their
/// times say nothing about each other.
void checkComparable(const Json& earlier, const Json& later);

/// What got faster or slower from one document to another, beyond what differs between runs of one build.
///
/// Times of one case differ between two runs of one program by more than their intervals within a run say: a
/// machine has good and bad minutes. So the ratios of all cases of an algorithm are taken together, over the
/// median of all algorithms, peers among them. An algorithm is named when the median of its ratios is off by
/// more than 12 % and the interval of that median, by order statistics, doesn't hold 1; with fewer than four
/// algorithms, when it is off by 25 % from the earlier time itself. When all together are off by 25 %, a
/// fixed piece of work that is timed in every round tells whether that may be the machine. Gives {"common":
/// .., "yardstick": .., "algorithms": [..], "cases": [..], "sentences": [..]}.
Json compareBenchmarks(const Json& earlier, const Json& later);

}  // namespace tessera
