#include "job/wrap_text.h"

#include <algorithm>
#include <string_view>

namespace tessera {

namespace {

constexpr std::size_t kContinuation = 4;  // more than the line that is continued

bool beginsCharacter(char c) {
    return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
}

/// The first `count` characters.
std::string_view firstOf(std::string_view text, std::size_t count) {
    std::size_t end = 0;
    for (std::size_t seen = 0; end < text.size(); ++end)
        if (beginsCharacter(text[end]) && seen++ == count) break;
    return text.substr(0, end);
}

std::string_view lastOf(std::string_view text, std::size_t count) {
    std::size_t begin = text.size();
    for (std::size_t seen = 0; begin > 0 && seen < count;)
        if (beginsCharacter(text[--begin])) ++seen;
    return text.substr(begin);
}

}  // namespace

std::size_t textWidth(const std::string& text) {
    return std::size_t(std::count_if(text.begin(), text.end(), beginsCharacter));
}

std::string shortened(const std::string& text, std::size_t width) {
    width = std::max<std::size_t>(width, 5);
    if (textWidth(text) <= width) return text;
    const std::size_t front = (width - 2) / 2, back = width - 3 - front;
    return std::string(firstOf(text, front)) + "..." + std::string(lastOf(text, back));
}

std::string wrapLine(const std::string& line, std::size_t width, std::size_t indent) {
    if (textWidth(line) <= width) return line;
    const std::size_t begin = std::min(line.find_first_not_of(' '), line.size());
    std::string text = line.substr(0, begin);
    std::size_t column = begin;
    for (std::size_t at = begin; at < line.size();) {
        // A word with the spaces before it, which a new line doesn't need.
        const std::size_t word = std::min(line.find_first_not_of(' ', at), line.size());
        const std::size_t end = std::min(line.find(' ', word), line.size());
        const std::size_t columns = textWidth(line.substr(word, end - word));
        if (at > begin && column + (word - at) + columns > width) {
            text += '\n';
            text.append(indent, ' ');
            column = indent;
        } else {
            text.append(word - at, ' ');
            column += word - at;
        }
        text.append(line, word, end - word);
        column += columns;
        at = end;
    }
    return text;
}

std::string wrapLines(const std::string& text, std::size_t width) {
    std::string wrapped;
    for (std::size_t begin = 0; begin < text.size();) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        const std::string line = text.substr(begin, end - begin);
        wrapped += wrapLine(line, width, std::min(line.find_first_not_of(' '), line.size()) + kContinuation);
        if (end < text.size()) wrapped += '\n';
        begin = end + 1;
    }
    return wrapped;
}

}  // namespace tessera
