#include "benchmark/quoted_text.h"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <string_view>

namespace tessera {

namespace {

/// In `quote`, with `inside` in place of each one that the text has.
std::string quoted(const std::string& text, char quote, std::string_view inside) {
    std::string word(1, quote);
    for (const char c : text)
        if (c == quote)
            word += inside;
        else
            word += c;
    return word + quote;
}

bool isPlain(char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || (c != 0 && std::strchr("_-./:+,@%", c));
}

}  // namespace

std::string csvText(const std::string& text) {
    return quoted(text, '"', "\"\"");
}

std::string shellWord(const std::string& text) {
    if (!text.empty() && std::all_of(text.begin(), text.end(), isPlain)) return text;
    return quoted(text, '\'', "'\\''");
}

}  // namespace tessera
