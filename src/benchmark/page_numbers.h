#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "benchmark/page_json.h"

namespace tessera {

/// A narrow space that no line breaks at: between thousands, and before units.
inline constexpr const char* kThinSpace = "\u202f";

// Numbers for reading, of three digits, in UTF-8.
std::string threeDigits(double value);
/// 0.0000012 -> "1.2" and ten to the power of -6, in small figures above the line.
std::string asPower(double value, int digits);
/// 1234567 -> "1 234 567", with thin spaces.
std::string wholeText(double value);
/// From nanoseconds to seconds.
std::string timeText(double ms);
/// "1.10 to 1.30 ms"; empty where it is a point.
std::string rangeText(const PageTime& time);
/// "1.20 ms (1.10 to 1.30 ms)"; without the interval where it is a point.
std::string intervalText(const PageTime& time);
/// 0.02 -> "2.00 %"; zero is "0".
std::string percentText(double share);
/// 0.02 -> "2 %".
std::string boundText(double share);
/// 2097152 -> "2.10 million".
std::string amountText(double count);
std::string bytesText(double bytes);
/// "3.21 times".
std::string timesText(double ratio);
/// A speed over another: "2.67" and the sign for times, or "1/9.60" of it.
std::string speedText(double ratio);

/// "a", "a and b", "a, b and c".
std::string listInWords(const std::vector<std::string>& words);

/// Characters, not bytes.
std::size_t lengthOf(std::string_view text);
/// At most so many characters, the last one three dots where something is lost.
std::string shortenedTo(const std::string& text, std::size_t characters);

}  // namespace tessera
