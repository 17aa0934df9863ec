#include "base/round_numbers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace tessera {

namespace {

/// What rounding may take from a length that is round.
constexpr double kNearly = 1e-9;

}  // namespace

double roundLengthBelow(double length) {
    const double power = std::pow(10.0, std::floor(std::log10(length)));
    double best = power;
    for (const double factor : {2.0, 5.0, 10.0})
        if (factor * power <= length * (1 + kNearly)) best = factor * power;
    return best;
}

double roundLengthAbove(double length) {
    const double power = std::pow(10.0, std::floor(std::log10(length)));
    for (const double factor : {1.0, 2.0, 5.0})
        if (factor * power >= length * (1 - kNearly)) return factor * power;
    return 10 * power;
}

std::string roundNumberText(double value, double step) {
    std::array<char, 64> text{};
    if (std::abs(value) < step / 2) return "0";
    const int exponent = int(std::floor(std::log10(step) + kNearly));
    if (std::abs(value) < 1e6 && step > 0.9e-4)
        std::snprintf(text.data(), text.size(), "%.*f", std::max(0, -exponent), value);
    else
        std::snprintf(text.data(), text.size(), "%.*g",
                      std::clamp(int(std::floor(std::log10(std::abs(value)))) - exponent + 1, 1, 15), value);
    return text.data();
}

}  // namespace tessera
