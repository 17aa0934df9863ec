#include "files/base64.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace tessera {

namespace {

constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

}  // namespace

std::string encodeBase64(std::string_view bytes) {
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
        std::uint32_t bits = 0;
        for (std::size_t b = 0; b < 3; ++b)
            bits = bits << 8 | (b < count ? std::uint32_t(static_cast<unsigned char>(bytes[i + b])) : 0u);
        for (std::size_t d = 0; d < 4; ++d) text += d <= count ? kDigits[bits >> (18 - 6 * d) & 63] : '=';
    }
    return text;
}

std::optional<std::string> decodeBase64(std::string_view text) {
    if (text.size() % 4 != 0) return std::nullopt;
    std::string bytes;
    bytes.reserve(text.size() / 4 * 3);
    for (std::size_t i = 0; i < text.size(); i += 4) {
        const std::string_view four = text.substr(i, 4);
        std::size_t count = 3;
        if (i + 4 == text.size()) count -= four.ends_with("==") ? 2u : four.ends_with('=') ? 1u : 0u;
        std::uint32_t bits = 0;
        for (std::size_t d = 0; d < 4; ++d) {
            const std::size_t digit = d <= count ? kDigits.find(four[d]) : 0;
            if (digit == std::string_view::npos) return std::nullopt;
            bits = bits << 6 | std::uint32_t(digit);
        }
        if (count < 3 && (bits & ((1u << (24 - 8 * count)) - 1)) != 0) return std::nullopt;
        for (std::size_t b = 0; b < count; ++b) bytes += char(bits >> (16 - 8 * b) & 255);
    }
    return bytes;
}

}  // namespace tessera
