#pragma once

#include <string>

namespace tessera {

/// A text as a cell of a .csv file: in quotes.
std::string csvText(const std::string& text);
/// A text as one word of /bin/sh: in quotes where it needs them.
std::string shellWord(const std::string& text);

}  // namespace tessera
