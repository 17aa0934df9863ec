#include "benchmark/machine_rates.h"

#include <sys/mman.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <new>
#include <numeric>
#include <thread>
#include <vector>

#include "base/timer.h"
#include "benchmark/median_interval.h"

namespace tessera {

namespace {

constexpr std::size_t kProbeBytes = std::size_t(256) << 20;

/// Milliseconds until each of the threads has done its share of [0, count).
double timeShares(int threads, std::size_t count, const std::function<void(std::size_t, std::size_t)>& work) {
    const Timer timer;
    std::vector<std::thread> others;
    const std::size_t share = count / std::size_t(threads);
    for (int t = 1; t < threads; ++t) others.emplace_back(work, std::size_t(t) * share, share);
    work(0, share);
    for (std::thread& other : others) other.join();
    return timer.elapsedMs();
}

/// Steps of eight chains that need no memory.
void compute(std::size_t steps) {
    std::array<double, 8> x{1, 2, 3, 4, 5, 6, 7, 8};
    for (std::size_t i = 0; i < steps; ++i)
        for (double& value : x) value = value * 0.999999 + 1e-7;
    if (std::accumulate(x.begin(), x.end(), 0.0) < 0) std::abort();  // never: the sum is wanted
}

/// Fresh pages of the system's.
class Pages {
  public:
    explicit Pages(bool large)
        : data_(static_cast<char*>(
              ::mmap(nullptr, kProbeBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0))) {
        if (data_ == MAP_FAILED) throw std::bad_alloc();
        ::madvise(data_, kProbeBytes, large ? MADV_HUGEPAGE : MADV_NOHUGEPAGE);
    }
    ~Pages() { ::munmap(data_, kProbeBytes); }
    Pages(const Pages&) = delete;
    Pages& operator=(const Pages&) = delete;
    char* data() { return data_; }

  private:
    char* data_;
};

}  // namespace

MachineRates measureMachine(int threads, int runs) {
    std::array<std::vector<double>, 5> ms;
    constexpr std::size_t kSteps = 40'000'000;
    Pages from(true), to(true);
    std::memset(from.data(), 1, kProbeBytes);
    std::memset(to.data(), 1, kProbeBytes);
    for (int run = 0; run < runs; ++run) {
        ms[0].push_back(timeShares(threads, kProbeBytes, [&](std::size_t at, std::size_t n) {
            std::memset(to.data() + at, run, n);
        }));
        ms[1].push_back(timeShares(threads, kProbeBytes, [&](std::size_t at, std::size_t n) {
            std::memcpy(to.data() + at, from.data() + at, n);
        }));
        for (const bool large : {false, true}) {
            Pages fresh(large);
            ms[large ? 3 : 2].push_back(timeShares(threads, kProbeBytes, [&](std::size_t at, std::size_t n) {
                std::memset(fresh.data() + at, run, n);
            }));
        }
        ms[4].push_back(timeShares(threads, kSteps, [](std::size_t, std::size_t n) { compute(n); }));
    }
    const auto rate = [&](int probe) {
        return double(kProbeBytes) / 1e6 / medianInterval(ms[std::size_t(probe)]).median;
    };
    return {threads, rate(0), 2 * rate(1), rate(2), rate(3), double(kSteps) / medianInterval(ms[4]).median};
}

double runYardstick(int threads) {
    constexpr std::size_t kSteps = 8'000'000, kBytes = std::size_t(32) << 20;
    static const std::vector<char> from(kBytes, 1);
    static std::vector<char> to(kBytes);
    const double arithmeticMs = timeShares(threads, kSteps, [](std::size_t, std::size_t n) { compute(n); });
    const double memoryMs = timeShares(threads, kBytes, [](std::size_t at, std::size_t n) {
        for (int pass = 0; pass < 2; ++pass) std::memcpy(to.data() + at, from.data() + at, n);
    });
    return arithmeticMs + memoryMs;
}

}  // namespace tessera
