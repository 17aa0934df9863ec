#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "base/picture_marks.h"
#include "base/rgba_image.h"
#include "brick/seams.h"
#include "mesh/field_range.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// A picture of one number a pixel, row by row from the top left.
struct ScalarImage {
    int width = 0;
    int height = 0;
    std::vector<float> values;           ///< width x height
    std::vector<std::uint8_t> coverage;  ///< width x height: 0 where the pixel has no value
    /// width x height, or empty: 1 where a brick's edge is drawn over it
    std::vector<std::uint8_t> outlines;

    std::size_t offset(int x, int y) const { return std::size_t(y) * std::size_t(width) + std::size_t(x); }
};

/// Range of the finite values where there is coverage.
ValueRange shownRange(std::span<const float> values, std::span<const std::uint8_t> coverage);

/// 8 bits of red, green and blue a pixel, row by row from the top left.
struct RgbImage {
    int width = 0;
    int height = 0;
    std::vector<std::uint8_t> rgb;
};

struct Rgb {
    std::uint8_t r = 0, g = 0, b = 0;
    friend bool operator==(const Rgb&, const Rgb&) = default;
};

/// Colour of a share in [0, 1] (clamped): dark blue over green to yellow, its lightness (CIE L*) rising
/// evenly so that equal steps of the value look equally large, also in grey.
Rgb mapColour(double share);

struct PictureOptions {
    std::string title;        ///< shown above the picture
    double min = 0, max = 0;  ///< range of the colours; equal: the range of the finite values
    int magnify = 1;          ///< picture pixels along a value's edge
};

/// The values in colours, a light pattern where there are none, the title, and a colour bar with five
/// labelled ticks.
RgbImage drawPicture(const ScalarImage& image, const PictureOptions& options);

/// A picture before a ground of one colour, red, green and blue from 0 to 1.
RgbImage overGround(const RgbaImage& image, const std::array<double, 3>& ground);

/// What a colour bar tells.
struct LegendOptions {
    std::string title;
    double min = 0, max = 1;     ///< at its ends
    bool isLogarithmic = false;  ///< equal factors of the value take equal parts of the bar
};
/// What a legend takes of the picture's width; 0 when the picture has no room for it.
int legendPixels(const LegendOptions& options, int pictureWidth, int pictureHeight);
/// Puts a colour bar with labelled ticks onto the right of a picture, on paper of its own, where there is
/// room. @param colourAt of a value.
void putLegend(RgbImage& picture, const LegendOptions& options,
               const std::function<Rgb(double value)>& colourAt);

/// Puts boxes and words onto a picture; words have a rim of the ground's colour, so that they can be read
/// before anything.
void putMarks(RgbImage& picture, const PictureMarks& marks, const std::array<double, 3>& ground);

/// Throws IoError; nothing stands at `path` until the file is whole.
void writePng(const std::string& path, const RgbImage& image);
/// drawPicture and writePng in one.
void writeSlicePng(const std::string& path, const ScalarImage& image, const PictureOptions& options);

}  // namespace tessera
