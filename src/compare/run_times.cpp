#include "compare/run_times.h"

#include <algorithm>
#include <vector>

#include "base/check.h"
#include "base/timer.h"

namespace tessera {

namespace {

double medianOf(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size();
    return n % 2 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

}  // namespace

RunTimes timeRuns(BoundResampler& resampler, const Lattice& lattice, std::span<const IndexBox> boxes,
                  int runs, const Execution& execution) {
    TESSERA_CHECK(runs > 0, "times come from at least one run");
    std::vector<double> totals;
    std::vector<ResampleStatistics> all;
    for (int r = 0; r < runs; ++r) {
        Timer timer;
        all.push_back(resampler.resample(
            lattice, boxes, [](std::size_t, const Block&) {}, execution));
        totals.push_back(timer.elapsedMs());
    }
    RunTimes result{runs, medianOf(totals), all.back()};
    for (const auto& [stage, last] : all.back().stages()) {
        std::vector<double> values;
        for (const ResampleStatistics& s : all) values.push_back(s.ms(stage));
        result.statistics.setMs(stage, medianOf(std::move(values)));
    }
    return result;
}

}  // namespace tessera
