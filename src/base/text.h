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

}  // namespace tessera
