#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "tessera/vec.h"

namespace tessera {

/// Shortest decimal text that reads back to the same double.
std::string exactText(double value);

/// A number for sentences, rounded to so many digits.
std::string shortNumber(double value, int digits = 4);
/// A place, coordinates rounded to six digits: (1, 2.5, -3).
std::string placeText(const Vec3d& place);

/// The characters of UTF-8 text; a byte that is no part of one counts as one unknown character.
std::vector<char32_t> decodeUtf8(std::string_view text);

/// Texts from files may hold what a terminal obeys: control characters become spaces but for line ends, also
/// those of Unicode and those that turn the direction of writing, and bytes that are no UTF-8 question marks.
std::string withoutControls(std::string_view text);
/// The same with line ends as spaces too, and no space at the end.
std::string singleLine(std::string_view text);
/// The same of at most kLongestMessageBytes: a longer one loses its middle.
std::string messageLine(std::string_view text);
/// With what a program puts before it a line of 1000 bytes.
inline constexpr std::size_t kLongestMessageBytes = 980;
/// Small letters in place of the capital ones of ASCII.
std::string lowerCase(std::string_view text);
/// A name that a file gives something: control characters of ASCII become spaces, all else stays.
std::string plainName(std::string name);

}  // namespace tessera
