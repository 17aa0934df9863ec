#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tessera {

/// Shortest decimal text that reads back to the same double.
std::string exactText(double value);

/// The characters of UTF-8 text; a byte that is no part of one counts as one unknown character.
std::vector<char32_t> decodeUtf8(std::string_view text);

}  // namespace tessera
