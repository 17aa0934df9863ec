#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "benchmark/median_interval.h"
#include "tessera/execution.h"
#include "tessera/statistics.h"

namespace tessera {

/// What one run of a case took.
struct CaseSample {
    double ms = 0;           ///< what is compared
    double wallMs = 0;       ///< what the run took all in all: for plans of how long others will
    double processorMs = 0;  ///< of all threads of this process
    std::vector<std::pair<std::string_view, double>> stagesMs;
    ResampleStatistics statistics;
};

/// Something that is run again and again, in turn with others.
struct TimedCase {
    std::string what;    ///< for people: "software, 128 points"
    std::string ladder;  ///< cases of one kind, each with more work than the one before
    double work = 0;     ///< of this rung, in any unit: tells how long the next one will take
    /// Once, before all else: finds out what isn't timed. Takes about as long as a run. May be null.
    std::function<void(const Execution&)> prepare;
    std::function<CaseSample(const Execution&)> run;
    bool isKept = false;  ///< not left out for want of time, only where it fails or takes far too long

    std::vector<CaseSample> samples;  ///< of the rounds
    CaseSample first;                 ///< of the run before them, shaders and caches cold
    std::string leftOut;              ///< why it isn't timed, a sentence
    bool isFollower = false;  ///< left out as the one before it on its ladder: there is no more to say

    bool isTimed() const { return !samples.empty(); }
    MedianInterval interval() const;
    double medianOf(const std::function<double(const CaseSample&)>& figure) const;
};

struct RoundOptions {
    int rounds = 9;
    std::uint64_t seed = 1;
    /// A sample of a short run is the median one of several, as many as fit into this, 15 at most.
    double sampleMs = 40;
    double longestRunMs =
        20e3;  ///< a case that takes longer is left out, as are those after it on its ladder
    /// Of all rounds: there are fewer where they would take longer; where six would, the longest cases are
    /// left out.
    double longestMs = 300e3;
};

/// Rounds in which every case runs once, in a random order of its own, so that what changes with time on the
/// machine changes for all. Before them every case runs once, in the given order; with those that fail or
/// take too long it ends. Returns the number of rounds. Throws Cancelled.
/// @param say one line about what is going on.
int runRounds(std::span<TimedCase> cases, const RoundOptions& options, const Execution& execution,
              const std::function<void(const std::string&)>& say);

/// Does the work; where it fails by what a case may fail by, bad input for it, its device or its program,
/// why.
std::string whyItFailed(const std::function<void()>& work);

/// Of two cases that ran in the same rounds: the second's time over the first's, round by round.
MedianInterval ratioOf(const TimedCase& first, const TimedCase& second);

/// Pairs of an element and a slice that it reaches, or where there are no slices of an element and a block.
std::int64_t pairsOf(const ResampleStatistics& statistics);

/// Times a piece of work, its processor time too.
CaseSample timed(const std::function<ResampleStatistics()>& work);

}  // namespace tessera
