#include "base/text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>

namespace tessera {

std::string exactText(double value) {
    std::array<char, 40> text{};
    const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value);
    return std::string(text.data(), end);
}

std::string shortNumber(double value, int digits) {
    std::array<char, 40> text{};
    std::snprintf(text.data(), text.size(), "%.*g", digits, value);
    return text.data();
}

std::string placeText(const Vec3d& place) {
    std::array<char, 96> text{};
    std::snprintf(text.data(), text.size(), "(%.6g, %.6g, %.6g)", place.x, place.y, place.z);
    return text.data();
}

std::vector<char32_t> decodeUtf8(std::string_view text) {
    std::vector<char32_t> codes;
    for (std::size_t i = 0; i < text.size();) {
        const auto lead = static_cast<unsigned char>(text[i++]);
        int more = lead >= 0xf8 ? 0 : lead >= 0xf0 ? 3 : lead >= 0xe0 ? 2 : lead >= 0xc0 ? 1 : 0;
        char32_t code = more == 0 ? lead : lead & (0x3fu >> more);
        if (lead >= 0xf8 || (lead >= 0x80 && lead < 0xc0)) code = 0xfffd;
        for (; more > 0 && i < text.size() && (static_cast<unsigned char>(text[i]) & 0xc0) == 0x80; --more)
            code = code << 6 | (static_cast<unsigned char>(text[i++]) & 0x3f);
        codes.push_back(more > 0 ? char32_t(0xfffd) : code);
    }
    return codes;
}

std::string withoutControls(std::string_view text) {
    const auto isControl = [](char32_t code) {
        return (code < 0x20 && code != '\n') || (code >= 0x7f && code < 0xa0) || code == 0x061c ||
               (code >= 0x200e && code <= 0x200f) || (code >= 0x2028 && code <= 0x202e) ||
               (code >= 0x2066 && code <= 0x2069);
    };
    std::string plain;
    for (std::size_t i = 0; i < text.size();) {
        const std::size_t begin = i;
        do ++i;
        while (i < text.size() && (static_cast<unsigned char>(text[i]) & 0xc0) == 0x80);
        const std::string_view bytes = text.substr(begin, i - begin);
        const std::vector<char32_t> codes = decodeUtf8(bytes);
        if (codes.size() > 1 || codes[0] == 0xfffd)
            plain.append(codes.size(), '?');
        else if (isControl(codes[0]))
            plain += ' ';
        else
            plain += bytes;
    }
    return plain;
}

std::string singleLine(std::string_view text) {
    std::string line = withoutControls(text);
    std::replace(line.begin(), line.end(), '\n', ' ');
    line.erase(line.find_last_not_of(' ') + 1);
    return line;
}

std::string messageLine(std::string_view text) {
    std::string line = singleLine(text);
    if (line.size() <= kLongestMessageBytes) return line;
    const auto isInCharacter = [&](std::size_t at) { return (line[at] & 0xc0) == 0x80; };
    std::size_t front = kLongestMessageBytes / 2, back = line.size() - kLongestMessageBytes / 2 + 3;
    while (front > 0 && isInCharacter(front)) --front;
    while (back < line.size() && isInCharacter(back)) ++back;
    return line.substr(0, front) + "..." + line.substr(back);
}

std::string lowerCase(std::string_view text) {
    std::string lower(text);
    for (char& c : lower)
        if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
    return lower;
}

std::string plainName(std::string name) {
    for (char& c : name)
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
    return name;
}

}  // namespace tessera
