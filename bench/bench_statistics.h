#pragma once

#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace tessera::bench {

/// Median of a figure of each sample; the mean of the middle two when their number is even.
template <class Sample, class Figure>
double medianOf(const std::vector<Sample>& samples, Figure figure) {
    std::vector<double> values;
    for (const Sample& s : samples) values.push_back(figure(s));
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size();
    return n % 2 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

/// Processor time of all threads of this process so far, in milliseconds. On a busy machine it is steadier
/// than the wall clock.
inline double processorMs() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto ms = [](const timeval& t) { return double(t.tv_sec) * 1e3 + double(t.tv_usec) * 1e-3; };
    return ms(usage.ru_utime) + ms(usage.ru_stime);
}

/// Writes a file, unless the path is empty. Throws std::runtime_error.
inline void writeText(const std::string& path, const std::string& text) {
    if (!path.empty() && !(std::ofstream(path) << text))
        throw std::runtime_error(path + ": can't be written");
}

}  // namespace tessera::bench
