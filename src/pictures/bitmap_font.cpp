#include "pictures/bitmap_font.h"

#include <cstddef>

namespace tessera {
namespace {

// One digit in base 32 (0-9, a-v) for each of a glyph's seven rows, from the top.
struct Glyph {
    char character;
    const char* rows;
};

constexpr Glyph kGlyphs[] = {
    {' ', "0000000"},  {'0', "ehjlphe"}, {'1', "4c4444e"}, {'2', "eh1248v"}, {'3', "v2421he"},
    {'4', "26aiv22"},  {'5', "vgu11he"}, {'6', "68guhhe"}, {'7', "v124888"}, {'8', "ehhehhe"},
    {'9', "ehhf12c"},  {'A', "ehhvhhh"}, {'B', "uhhuhhu"}, {'C', "ehggghe"}, {'D', "sihhhis"},
    {'E', "vggugge"},  {'F', "vgguggg"}, {'G', "ehgnhhf"}, {'H', "hhhvhhh"}, {'I', "e44444e"},
    {'J', "72222ic"},  {'K', "hikokih"}, {'L', "ggggggv"}, {'M', "hrllhhh"}, {'N', "hhpljhh"},
    {'O', "ehhhhhe"},  {'P', "uhhuggg"}, {'Q', "ehhhlid"}, {'R', "uhhukih"}, {'S', "fgge11u"},
    {'T', "v444444"},  {'U', "hhhhhhe"}, {'V', "hhhhha4"}, {'W', "hhhllla"}, {'X', "hha4ahh"},
    {'Y', "hhha444"},  {'Z', "v1248gv"}, {'a', "00e1fhf"}, {'b', "ggmphhu"}, {'c', "00egghe"},
    {'d', "11djhhf"},  {'e', "00ehvge"}, {'f', "698s888"}, {'g', "0fhhf1e"}, {'h', "ggmphhh"},
    {'i', "40c444e"},  {'j', "20622ic"}, {'k', "ggikoki"}, {'l', "c44444e"}, {'m', "00qllhh"},
    {'n', "00mphhh"},  {'o', "00ehhhe"}, {'p', "00uhugg"}, {'q', "00djf11"}, {'r', "00mpggg"},
    {'s', "00ege1u"},  {'t', "88s8896"}, {'u', "00hhhjd"}, {'v', "00hhha4"}, {'w', "00hhlla"},
    {'x', "00ha4ah"},  {'y', "00hhf1e"}, {'z', "00v248v"}, {'.', "00000cc"}, {',', "0000c48"},
    {'-', "000v000"},  {'+', "044v440"}, {':', "0cc0cc0"}, {'/', "01248g0"}, {'(', "2488842"},
    {')', "8422248"},  {'[', "e88888e"}, {']', "e22222e"}, {'=', "00v0v00"}, {'%', "op248j3"},
    {'_', "000000v"},  {'*', "04lel40"}, {'<', "248g842"}, {'>', "8421248"}, {'|', "4444444"},
    {'\'', "c480000"}, {'"', "aaa0000"}, {'#', "aavavaa"},
};
constexpr const char* kUnknown = "vhhhhhv";

std::uint8_t digit(char c) {
    return std::uint8_t(c <= '9' ? c - '0' : c - 'a' + 10);
}

}  // namespace

std::array<std::uint8_t, kGlyphHeight> glyphRows(char32_t code) {
    const char* rows = kUnknown;
    for (const Glyph& glyph : kGlyphs) {
        if (char32_t(glyph.character) == code) rows = glyph.rows;
    }
    std::array<std::uint8_t, kGlyphHeight> bits{};
    for (std::size_t i = 0; i < bits.size(); ++i) bits[i] = digit(rows[i]);
    return bits;
}

}  // namespace tessera
