#pragma once

#include <array>
#include <string>
#include <vector>

namespace tessera {

/// Red, green and blue from 0 to 1.
using MarkColor = std::array<double, 3>;

/// Words on a picture. Their box touches the place, and lies from there in the direction (x right, y down).
/// Where both of the direction are 0 the place is their middle.
struct PictureWords {
    std::string text;
    std::array<double, 2> placePixels{};
    std::array<double, 2> direction{};
    MarkColor color{};
};

/// A filled box on a picture, from its top left.
struct PictureBox {
    double leftPixels = 0, topPixels = 0, widthPixels = 0, heightPixels = 0;
    MarkColor color{};
};

/// What is put onto a picture when it is drawn, from the top left.
struct PictureMarks {
    /// A letter's dot, in pixels; letters are kLetterDots wide, with the gap behind them, and high.
    int dotPixels = 1;
    std::vector<PictureBox> boxes;
    /// Those that would lie on words before them are left out.
    std::vector<PictureWords> words;
};
inline constexpr std::array<int, 2> kLetterDots{6, 7};

}  // namespace tessera
