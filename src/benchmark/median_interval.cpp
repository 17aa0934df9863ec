#include "benchmark/median_interval.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr double kConfidence = 0.95;

/// The largest k for which the k-th smallest and the k-th largest of n values have the median between them
/// with the confidence; 1 where none has.
std::size_t orderOf(std::size_t n) {
    double term = std::pow(0.5, double(n)), below = 0;  // P(Binomial(n, 1/2) = 0)
    std::size_t k = 0;
    while (2 * (below + term) <= 1 - kConfidence && k < n) {
        below += term;
        term *= double(n - k) / double(k + 1);
        ++k;
    }
    return std::max<std::size_t>(k, 1);
}

}  // namespace

MedianInterval medianInterval(std::vector<double> values) {
    TESSERA_CHECK(!values.empty(), "a median is of something");
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size(), k = orderOf(n);
    return {(values[(n - 1) / 2] + values[n / 2]) / 2, values[k - 1], values[n - k], n};
}

Json intervalJson(const MedianInterval& interval) {
    return {{"median", interval.median},
            {"low", interval.low},
            {"high", interval.high},
            {"count", interval.count}};
}

MedianInterval intervalFrom(const Json& json) {
    try {
        return {json.at("median").get<double>(), json.at("low").get<double>(), json.at("high").get<double>(),
                json.at("count").get<std::size_t>()};
    } catch (const Json::exception&) {
        throw InputError("a time lacks its median, interval or count: " + json.dump());
    }
}

}  // namespace tessera
