#include "benchmark/page_numbers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tessera {

namespace {

std::string withUnit(const std::string& number, std::string_view unit) {
    return fmt::format("{}{}{}", number, kThinSpace, unit);
}

struct UnitStep {
    double from, divisor;
    const char* name;
};

}  // namespace

std::string wholeText(double value) {
    const std::string digits = fmt::format("{:.0f}", std::abs(value));
    std::string text = value < 0 && digits != "0" ? "-" : "";
    for (std::size_t i = 0; i < digits.size(); ++i) {
        if (i > 0 && (digits.size() - i) % 3 == 0 && digits.size() > 4) text += kThinSpace;
        text += digits[i];
    }
    return text;
}

std::string asPower(double value, int digits) {
    constexpr const char* kRaised[] = {"\u2070", "\u00b9", "\u00b2", "\u00b3", "\u2074",
                                       "\u2075", "\u2076", "\u2077", "\u2078", "\u2079"};
    const std::string text = fmt::format("{:.{}e}", value, digits - 1);
    const std::size_t e = text.find('e');
    const int power = std::stoi(text.substr(e + 1));
    std::string raised = power < 0 ? "\u207b" : "";
    for (const char c : std::to_string(std::abs(power))) raised += kRaised[c - '0'];
    const std::string factor = text.substr(0, e);
    return (factor == "1" ? "" : factor + "\u00b7") + "10" + raised;
}

std::string threeDigits(double value) {
    const double size = std::abs(value);
    if (size == 0) return "0";
    if (size < 1e-3 || size >= 1e12) return asPower(value, 3);
    const double power = std::floor(std::log10(size)) - 2;
    const double rounded = std::round(value / std::pow(10, power)) * std::pow(10, power);
    if (power >= 0) return wholeText(rounded);
    // 9.996 becomes 10.00 where its digits are counted before it is rounded.
    const int decimals = int(2 - std::floor(std::log10(std::abs(rounded)) + 1e-9));
    return fmt::format("{:.{}f}", rounded, std::max(decimals, 0));
}

std::string timeText(double ms) {
    if (ms == 0) return withUnit("0", "ms");
    const double size = std::abs(ms);
    if (size < 0.9995e-3) return withUnit(threeDigits(ms * 1e6), "ns");
    if (size < 0.9995) return withUnit(threeDigits(ms * 1e3), "\u00b5s");
    if (size < 999.5) return withUnit(threeDigits(ms), "ms");
    return withUnit(threeDigits(ms / 1e3), "s");
}

std::string rangeText(const PageTime& time) {
    if (time.low == time.high) return {};
    std::string low = timeText(time.low);
    const std::string high = timeText(time.high);
    const std::size_t unit = low.rfind(kThinSpace), highUnit = high.rfind(kThinSpace);
    if (low.substr(unit) == high.substr(highUnit)) low.resize(unit);
    return low + " to " + high;
}

std::string intervalText(const PageTime& time) {
    const std::string range = rangeText(time);
    return range.empty() ? timeText(time.median) : fmt::format("{} ({})", timeText(time.median), range);
}

std::string percentText(double share) {
    return share == 0 ? "0" : withUnit(threeDigits(share * 100), "%");
}

std::string boundText(double share) {
    return withUnit(fmt::format("{:.4g}", share * 100), "%");
}

std::string amountText(double count) {
    if (count >= 999.5e6) return withUnit(threeDigits(count / 1e9), "billion");
    if (count >= 999.5e3) return withUnit(threeDigits(count / 1e6), "million");
    return wholeText(count);
}

std::string bytesText(double bytes) {
    constexpr UnitStep kUnits[] = {
        {999.5e9, 1e12, "TB"}, {999.5e6, 1e9, "GB"}, {999.5e3, 1e6, "MB"}, {999.5, 1e3, "kB"}};
    for (const UnitStep& unit : kUnits)
        if (bytes >= unit.from) return withUnit(threeDigits(bytes / unit.divisor), unit.name);
    return withUnit(wholeText(bytes), "bytes");
}

std::string timesText(double ratio) {
    return withUnit(threeDigits(ratio), "times");
}

std::string speedText(double ratio) {
    if (ratio >= 1 || ratio <= 0) return threeDigits(ratio) + "\u00d7";
    return "1/" + threeDigits(1 / ratio);
}

std::string listInWords(const std::vector<std::string>& words) {
    std::string text;
    for (std::size_t i = 0; i < words.size(); ++i)
        text += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
    return text;
}

std::size_t lengthOf(std::string_view text) {
    return std::size_t(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string shortenedTo(const std::string& text, std::size_t characters) {
    if (lengthOf(text) <= characters) return text;
    std::string shorter;
    std::size_t left = characters;
    for (const char c : text) {
        if ((c & 0xC0) != 0x80 && --left == 0) break;
        shorter += c;
    }
    return shorter + "\u2026";
}

}  // namespace tessera
