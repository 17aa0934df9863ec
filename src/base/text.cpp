#include "base/text.h"

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

}  // namespace tessera
