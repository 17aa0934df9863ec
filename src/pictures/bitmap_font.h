#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

inline constexpr int kGlyphWidth = 5;
inline constexpr int kGlyphHeight = 7;
inline constexpr int kGlyphAdvance = kGlyphWidth + 1;

/// Rows of a character from the top, bit 4 is the leftmost pixel. A code that has no glyph gives an empty
/// frame.
std::array<std::uint8_t, kGlyphHeight> glyphRows(char32_t code);

}  // namespace tessera
