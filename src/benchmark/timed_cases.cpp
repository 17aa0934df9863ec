#include "benchmark/timed_cases.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <map>
#include <mutex>
#include <numeric>
#include <random>
#include <thread>

#include "base/timer.h"
#include "resample/statistic_names.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kFewestRounds = 6;  // a 95 % interval needs so many values
constexpr double kPatience = 3;   // times the longest run: then a first one is ended
/// Time grows by about this power of the work; less, so that nothing is left out by mistake.
constexpr double kGrowth = 0.75;

double processorMs() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto ms = [](const timeval& t) { return double(t.tv_sec) * 1e3 + double(t.tv_usec) * 1e-3; };
    return ms(usage.ru_utime) + ms(usage.ru_stime);
}

/// Work that is cancelled when it takes too long, or when the caller's is.
class TimeLimit {
  public:
    TimeLimit(const Execution& outer, double limitMs) : inner_(outer) {
        inner_.cancel = &over_;
        inner_.progress = nullptr;
        watch_ = std::thread([this, limitMs, cancel = outer.cancel] {
            const Timer timer;
            std::unique_lock lock(mutex_);
            while (!done_ && timer.elapsedMs() < limitMs && !(cancel && *cancel))
                wake_.wait_for(lock, std::chrono::milliseconds(20));
            over_ = !done_;
        });
    }
    ~TimeLimit() {
        {
            const std::lock_guard lock(mutex_);
            done_ = true;
        }
        wake_.notify_one();
        watch_.join();
    }
    TimeLimit(const TimeLimit&) = delete;
    TimeLimit& operator=(const TimeLimit&) = delete;
    const Execution& execution() const { return inner_; }

  private:
    Execution inner_;
    std::atomic<bool> over_{false};
    std::mutex mutex_;
    std::condition_variable wake_;
    bool done_ = false;
    std::thread watch_;
};

constexpr int kMostRepeats = 15;

/// Of a sample, milliseconds.
double costOf(const TimedCase& one, const RoundOptions& options) {
    return std::max(one.first.wallMs, std::min(options.sampleMs, kMostRepeats * one.first.wallMs));
}

CaseSample sampleOf(const TimedCase& one, double sampleMs, const Execution& execution) {
    const double fit = one.first.wallMs > 0 ? sampleMs / one.first.wallMs : kMostRepeats;
    const int repeats = std::clamp(int(fit), 1, kMostRepeats) | 1;
    std::vector<CaseSample> samples;
    for (int r = 0; r < repeats; ++r) samples.push_back(one.run(execution));
    const auto middle = samples.begin() + repeats / 2;
    std::nth_element(samples.begin(), middle, samples.end(),
                     [](const CaseSample& a, const CaseSample& b) { return a.ms < b.ms; });
    return std::move(*middle);
}

/// What the last rung of a ladder took.
struct Rung {
    double ms = 0, work = 0;
    bool isLeftOut = false;
};

/// A sentence with what the case is.
std::string leftOutBecause(const TimedCase& one, const std::string& why) {
    return why.empty() ? why : fmt::format("{}: {}", one.what, why);
}

/// Ends work that takes far too long. @param what takes it: "a run".
void withinPatience(const char* what, const RoundOptions& options, const Execution& execution,
                    const std::function<void(const Execution&)>& work) {
    const double limitMs = kPatience * options.longestRunMs;
    const TimeLimit limit(execution, limitMs);
    try {
        work(limit.execution());
    } catch (const Cancelled&) {
        execution.throwIfCancelled();
        throw InputError(fmt::format("{} takes more than {:g} s", what, limitMs / 1000));
    }
}

void runFirst(TimedCase& one, Rung& rung, const RoundOptions& options, const Execution& execution) {
    const double expected =
        rung.work > 0 ? rung.ms * std::pow(std::max(1.0, one.work / rung.work), kGrowth) : 0;
    const std::string why = whyItFailed([&] {
        if (rung.isLeftOut) throw InputError("left out as the one before it");
        if (!one.isKept && expected > options.longestRunMs)
            throw InputError(fmt::format("a run would take about {:.2g} s", expected / 1000));
        if (one.prepare)
            withinPatience("a run with all that is found out once", options, execution, one.prepare);
        withinPatience("a run", options, execution,
                       [&](const Execution& inner) { one.first = one.run(inner); });
        if (!one.isKept && one.first.wallMs > options.longestRunMs)
            throw InputError(fmt::format("a run takes {:.3g} s", one.first.wallMs / 1000));
    });
    one.leftOut = leftOutBecause(one, why);
    one.isFollower = rung.isLeftOut;
    rung = {one.first.wallMs, one.work, !one.leftOut.empty()};
}

}  // namespace

MedianInterval TimedCase::interval() const {
    std::vector<double> ms;
    for (const CaseSample& sample : samples) ms.push_back(sample.ms);
    return medianInterval(std::move(ms));
}

double TimedCase::medianOf(const std::function<double(const CaseSample&)>& figure) const {
    std::vector<double> values;
    for (const CaseSample& sample : samples) values.push_back(figure(sample));
    return medianInterval(std::move(values)).median;
}

int runRounds(std::span<TimedCase> cases, const RoundOptions& options, const Execution& execution,
              const std::function<void(const std::string&)>& say) {
    std::map<std::string, Rung> rungs;
    const auto count = std::int64_t(cases.size());
    double roundMs = 0;
    std::vector<TimedCase*> timedOnes;
    for (std::int64_t i = 0; i < count; ++i) {
        TimedCase& one = cases[std::size_t(i)];
        execution.report(Stage::planning, i, count);
        runFirst(one, rungs[one.ladder], options, execution);
        if (!one.leftOut.empty()) continue;
        timedOnes.push_back(&one);
        roundMs += costOf(one, options);
    }
    // First runs are slower than later ones, so there is time for what is left.
    const int fewest = std::min(options.rounds, kFewestRounds);
    std::stable_sort(timedOnes.begin(), timedOnes.end(), [](const TimedCase* a, const TimedCase* b) {
        return a->isKept != b->isKept ? a->isKept : a->first.wallMs < b->first.wallMs;
    });
    while (!timedOnes.empty() && !timedOnes.back()->isKept && fewest * roundMs > options.longestMs) {
        TimedCase& longest = *timedOnes.back();
        longest.leftOut =
            fmt::format("{}: a run takes {:.2g} s, too long for {} rounds in {:g} s", longest.what,
                        longest.first.wallMs / 1000, fewest, options.longestMs / 1000);
        roundMs -= costOf(longest, options);
        timedOnes.pop_back();
    }
    if (timedOnes.empty()) return 0;
    std::sort(timedOnes.begin(), timedOnes.end());  // as they came: orders follow from the seed alone
    const int rounds = std::clamp(int(options.longestMs / roundMs), fewest, options.rounds);
    say(fmt::format("{} cases in {} rounds of about {:.2g} s\n", timedOnes.size(), rounds, roundMs / 1000));
    std::mt19937_64 random(options.seed);
    const auto runs = std::int64_t(timedOnes.size()) * rounds;
    for (std::int64_t run = 0; run < runs; ++run) {
        const std::size_t place = std::size_t(run) % timedOnes.size();
        if (place == 0) std::shuffle(timedOnes.begin(), timedOnes.end(), random);
        execution.report(Stage::sampling, run, runs);
        TimedCase& one = *timedOnes[place];
        if (!one.leftOut.empty()) continue;
        one.leftOut = leftOutBecause(
            one, whyItFailed([&] {
                one.samples.push_back(sampleOf(one, options.sampleMs, execution.withoutProgress()));
            }));
        if (!one.leftOut.empty()) one.samples.clear();
    }
    return rounds;
}

std::string whyItFailed(const std::function<void()>& work) {
    try {
        work();
        return {};
    } catch (const InputError& error) {
        return error.what();
    } catch (const GlError& error) {
        return error.what();
    } catch (const IoError& error) {
        return error.what();
    }
}

MedianInterval ratioOf(const TimedCase& first, const TimedCase& second) {
    std::vector<double> ratios;
    for (std::size_t i = 0; i < std::min(first.samples.size(), second.samples.size()); ++i)
        ratios.push_back(second.samples[i].ms / first.samples[i].ms);
    return medianInterval(std::move(ratios));
}

std::int64_t pairsOf(const ResampleStatistics& statistics) {
    const std::int64_t slices = statistics.count(counted::elementSlicePairs);
    return slices > 0 ? slices : statistics.count(counted::elementBlockPairs);
}

CaseSample timed(const std::function<ResampleStatistics()>& work) {
    CaseSample sample;
    const double before = processorMs();
    const Timer timer;
    sample.statistics = work();
    sample.ms = sample.wallMs = timer.elapsedMs();
    sample.processorMs = processorMs() - before;
    return sample;
}

}  // namespace tessera
