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
/// machine has good and bad minutes. So the ratios of all cases of an algorithm are taken together, over that
/// of the whole run: the median of one figure for the processor's algorithms, one for a device's and one for
/// peers, or without one of these for a fixed piece of work that is timed in every round (the yardstick). An
/// algorithm of six cases or more is named when the median of its ratios is off by more than 15 % and the
/// interval of that median, by order statistics, doesn't hold 1; where there is only one kind, when it is off
/// by 25 % from the earlier time itself. When the whole run is off by 25 %, a sentence
/// says so.
///
/// Gives {"common": .., "yardstick": .., "algorithms": [..], "cases": [..], "sentences": [..]}.
Json compareBenchmarks(const Json& earlier, const Json& later);

}  // namespace tessera
