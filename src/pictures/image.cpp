#include "pictures/image.h"

#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "base/check.h"
#include "base/text.h"
#include "files/atomic_file.h"
#include "pictures/bitmap_font.h"
#include "tessera/error.h"

namespace tessera {
namespace {

constexpr int kMargin = 14;
constexpr int kTextScale = 2;
constexpr int kBarWidth = 22;
constexpr int kTicks = 5;
constexpr int kSmallestHeight = 150;  // room for the ticks' labels
constexpr Rgb kPaper{255, 255, 255}, kInk{40, 40, 40};

// A colour of the CIE L*a*b* space (D65 white) in sRGB, not clamped: outside [0, 1] it can't be shown.
std::array<double, 3> srgbFromLab(double lightness, double a, double b) {
    const auto unpack = [](double t) {
        return t > 6.0 / 29 ? t * t * t : 3 * (6.0 / 29) * (6.0 / 29) * (t - 4.0 / 29);
    };
    const double fy = (lightness + 16) / 116;
    const double x = 0.95047 * unpack(fy + a / 500), y = unpack(fy), z = 1.08883 * unpack(fy - b / 200);
    const std::array<double, 3> linear{3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
                                       -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
                                       0.0556434 * x - 0.2040259 * y + 1.0572252 * z};
    std::array<double, 3> srgb{};
    for (std::size_t i = 0; i < 3; ++i) {
        const double v = linear[i];
        srgb[i] = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
    }
    return srgb;
}

// Lightness rises evenly from 15 to 90 while the hue turns from violet over blue and green to yellow; each
// colour is as strong as a screen can show, up to a bound that keeps the steps of the hue even.
Rgb computeColour(double share) {
    const double lightness = 15 + 75 * share;
    const double hue = (310 - 210 * std::pow(share, 0.9)) * std::acos(-1.0) / 180;
    double chroma = 34 + 44 * share * share;
    std::array<double, 3> colour{};
    for (bool shown = false; !shown; chroma -= 0.5) {
        colour = srgbFromLab(lightness, chroma * std::cos(hue), chroma * std::sin(hue));
        shown = chroma <= 0 ||
                std::all_of(colour.begin(), colour.end(), [](double v) { return v >= 0 && v <= 1; });
    }
    const auto byte = [](double v) { return std::uint8_t(std::lround(255 * std::clamp(v, 0.0, 1.0))); };
    return {byte(colour[0]), byte(colour[1]), byte(colour[2])};
}

RgbImage blankImage(int width, int height, Rgb colour) {
    RgbImage image{width, height, std::vector<std::uint8_t>(std::size_t(width) * std::size_t(height) * 3)};
    for (std::size_t i = 0; i < image.rgb.size(); i += 3) {
        image.rgb[i] = colour.r;
        image.rgb[i + 1] = colour.g;
        image.rgb[i + 2] = colour.b;
    }
    return image;
}

void setPixel(RgbImage& image, int x, int y, Rgb colour) {
    if (x < 0 || y < 0 || x >= image.width || y >= image.height) return;
    std::uint8_t* pixel = image.rgb.data() + (std::size_t(y) * std::size_t(image.width) + std::size_t(x)) * 3;
    pixel[0] = colour.r;
    pixel[1] = colour.g;
    pixel[2] = colour.b;
}

void fillBox(RgbImage& image, int x, int y, int width, int height, Rgb colour) {
    for (int j = 0; j < height; ++j)
        for (int i = 0; i < width; ++i) setPixel(image, x + i, y + j, colour);
}

int textWidth(const std::string& text, int scale = kTextScale) {
    return std::max(0, int(decodeUtf8(text).size()) * kGlyphAdvance - 1) * scale;
}

void drawText(RgbImage& image, int x, int y, const std::string& text, Rgb ink = kInk,
              int scale = kTextScale) {
    for (char32_t code : decodeUtf8(text)) {
        const auto rows = glyphRows(code);
        for (int j = 0; j < kGlyphHeight; ++j)
            for (int i = 0; i < kGlyphWidth; ++i) {
                if (rows[std::size_t(j)] >> (kGlyphWidth - 1 - i) & 1)
                    fillBox(image, x + i * scale, y + j * scale, scale, scale, ink);
            }
        x += kGlyphAdvance * scale;
    }
}

// A light check pattern tells "no value" from every colour of the map.
Rgb emptyColour(int x, int y) {
    return (x / 6 + y / 6) % 2 ? Rgb{236, 236, 236} : Rgb{222, 222, 222};
}

struct ColourRange {
    double min = 0, max = 0;
    double share(double value) const { return max > min ? (value - min) / (max - min) : 0.5; }
};

ColourRange chooseRange(const ScalarImage& image, const PictureOptions& options) {
    if (options.min < options.max) return {options.min, options.max};
    const ValueRange range = shownRange(image.values, image.coverage);
    return range.empty() ? ColourRange{} : ColourRange{range.min, range.max};
}

// Labels of ticks, with the fewest digits that tell them apart. @param valueAt of a share from 0 to 1.
std::vector<std::string> tickLabels(const ColourRange& range, const std::function<double(double)>& valueAt) {
    std::vector<std::string> labels;
    for (int digits = 3; digits <= 9; ++digits) {
        labels.clear();
        for (int t = 0; t < kTicks; ++t) {
            std::array<char, 40> text{};
            double value = valueAt(double(t) / (kTicks - 1));
            // The rounding of a tick between both signs at zero must not show as 1e-17.
            if (range.min < 0 && std::abs(value) < 1e-12 * (range.max - range.min)) value = 0;
            std::snprintf(text.data(), text.size(), "%.*g", digits, value);
            labels.emplace_back(text.data());
        }
        if (std::adjacent_find(labels.begin(), labels.end()) == labels.end()) break;
        if (!(range.min < range.max)) return {labels.front()};
    }
    return labels;
}

void drawValues(RgbImage& canvas, int left, int top, const ScalarImage& image, const ColourRange& range,
                int magnify) {
    for (int y = 0; y < image.height * magnify; ++y)
        for (int x = 0; x < image.width * magnify; ++x) {
            const std::size_t i = image.offset(x / magnify, y / magnify);
            const double value = double(image.values[i]);
            Rgb colour =
                image.coverage[i] && std::isfinite(value) ? mapColour(range.share(value)) : emptyColour(x, y);
            if (!image.outlines.empty() && image.outlines[i]) {
                // Half way to white on dark colours and to black on light ones.
                const bool dark = colour.r * 3 + colour.g * 6 + colour.b < 1100;
                const auto mix = [&](std::uint8_t v) { return std::uint8_t(dark ? (v + 255) / 2 : v / 2); };
                colour = {mix(colour.r), mix(colour.g), mix(colour.b)};
            }
            setPixel(canvas, left + x, top + y, colour);
        }
}

int widestOf(const std::vector<std::string>& labels) {
    int width = 0;
    for (const std::string& label : labels) width = std::max(width, textWidth(label));
    return width;
}

/// @param colourAt of a share from 0 to 1.
void drawBar(RgbImage& canvas, int left, int top, int height, const std::vector<std::string>& labels,
             const std::function<Rgb(double)>& colourAt) {
    fillBox(canvas, left - 1, top - 1, kBarWidth + 2, height + 2, kInk);
    for (int y = 0; y < height; ++y)
        fillBox(canvas, left, top + y, kBarWidth, 1,
                colourAt(height > 1 ? 1 - double(y) / (height - 1) : 0.5));
    const int count = int(labels.size());
    for (int t = 0; t < count; ++t) {
        const int y = count == 1 ? top + height / 2 : top + (height - 1) * (count - 1 - t) / (count - 1);
        fillBox(canvas, left + kBarWidth + 1, y - 1, 5, 2, kInk);
        const int textTop =
            std::clamp(y - kGlyphHeight * kTextScale / 2, top, top + height - kGlyphHeight * kTextScale);
        drawText(canvas, left + kBarWidth + 10, textTop, labels[std::size_t(t)]);
    }
}

}  // namespace

ValueRange shownRange(std::span<const float> values, std::span<const std::uint8_t> coverage) {
    ValueRange range;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double value = double(values[i]);
        if (!coverage[i] || !std::isfinite(value)) continue;
        range.min = std::min(range.min, value);
        range.max = std::max(range.max, value);
    }
    return range;
}

Rgb mapColour(double share) {
    static const std::vector<Rgb> table = [] {
        std::vector<Rgb> colours;
        for (int i = 0; i < 256; ++i) colours.push_back(computeColour(i / 255.0));
        return colours;
    }();
    if (!(share > 0)) return table.front();
    return table[std::size_t(std::lround(255 * std::min(share, 1.0)))];
}

RgbImage drawPicture(const ScalarImage& image, const PictureOptions& options) {
    const std::size_t pixels = std::size_t(image.width) * std::size_t(image.height);
    TESSERA_CHECK(image.width > 0 && image.height > 0 && image.values.size() == pixels &&
                      image.coverage.size() == pixels,
                  "a picture has a value and a coverage for every pixel");
    TESSERA_CHECK(image.outlines.empty() || image.outlines.size() == pixels,
                  "outlines have the picture's size");
    const int magnify = std::max(1, options.magnify);
    const ColourRange range = chooseRange(image, options);
    const std::vector<std::string> labels =
        tickLabels(range, [&](double share) { return range.min + (range.max - range.min) * share; });
    const int labelWidth = widestOf(labels);
    const int titleHeight = options.title.empty() ? 0 : kGlyphHeight * kTextScale + kMargin;
    const int innerWidth = image.width * magnify,
              innerHeight = std::max(image.height * magnify, kSmallestHeight);
    const int barLeft = kMargin + innerWidth + kMargin;
    const int width =
        std::max(barLeft + kBarWidth + 10 + labelWidth, kMargin + textWidth(options.title)) + kMargin;
    RgbImage canvas = blankImage(width, kMargin + titleHeight + innerHeight + kMargin, kPaper);
    const int top = kMargin + titleHeight;
    drawText(canvas, kMargin, kMargin, options.title);
    drawValues(canvas, kMargin, top, image, range, magnify);
    drawBar(canvas, barLeft, top, innerHeight, labels, mapColour);
    return canvas;
}

RgbImage overGround(const RgbaImage& image, const std::array<double, 3>& ground) {
    RgbImage result{image.width, image.height, {}};
    result.rgb.reserve(3 * image.pixels.size());
    for (const Rgba& pixel : image.pixels)
        for (std::size_t c = 0; c < 3; ++c) {
            const double value = double(pixel[c]) + (1 - double(pixel[3])) * ground[c];
            result.rgb.push_back(std::uint8_t(std::lround(255 * std::clamp(value, 0.0, 1.0))));
        }
    return result;
}

namespace {

/// How a legend is laid out.
struct LegendShape {
    std::function<double(double)> valueAt;  ///< of a share
    std::vector<std::string> labels;
    int titleHeight = 0, barHeight = 0, width = 0, height = 0;
    bool fits = false;
};

LegendShape shapeOf(const LegendOptions& options, int pictureWidth, int pictureHeight) {
    LegendShape shape;
    shape.valueAt = [options](double share) {
        return options.isLogarithmic ? options.min * std::pow(options.max / options.min, share)
                                     : options.min + share * (options.max - options.min);
    };
    shape.labels = tickLabels({options.min, options.max}, shape.valueAt);
    shape.titleHeight = options.title.empty() ? 0 : kGlyphHeight * kTextScale + kMargin;
    shape.width = std::max(kBarWidth + 10 + widestOf(shape.labels), textWidth(options.title)) + 2 * kMargin;
    shape.barHeight = std::min(pictureHeight / 2, 400);
    shape.height = shape.barHeight + shape.titleHeight + 2 * kMargin;
    shape.fits = shape.barHeight >= kSmallestHeight && 2 * (shape.width + kMargin) <= pictureWidth;
    return shape;
}

}  // namespace

int legendPixels(const LegendOptions& options, int pictureWidth, int pictureHeight) {
    const LegendShape shape = shapeOf(options, pictureWidth, pictureHeight);
    return shape.fits ? shape.width + kMargin : 0;
}

void putLegend(RgbImage& picture, const LegendOptions& options,
               const std::function<Rgb(double value)>& colourAt) {
    const LegendShape shape = shapeOf(options, picture.width, picture.height);
    if (!shape.fits) return;
    const int left = picture.width - shape.width - kMargin, top = (picture.height - shape.height) / 2;
    fillBox(picture, left, top, shape.width, shape.height, kPaper);
    drawText(picture, left + kMargin, top + kMargin, options.title);
    drawBar(picture, left + kMargin, top + kMargin + shape.titleHeight, shape.barHeight, shape.labels,
            [&](double share) { return colourAt(shape.valueAt(share)); });
}

void putMarks(RgbImage& picture, const PictureMarks& marks, const std::array<double, 3>& ground) {
    static_assert(kLetterDots[0] == kGlyphAdvance && kLetterDots[1] == kGlyphHeight);
    const auto rgb = [](const std::array<double, 3>& color) {
        const auto byte = [](double v) { return std::uint8_t(std::lround(255 * std::clamp(v, 0.0, 1.0))); };
        return Rgb{byte(color[0]), byte(color[1]), byte(color[2])};
    };
    const auto whole = [](double v) { return int(std::lround(std::clamp(v, -1e6, 1e6))); };
    for (const PictureBox& box : marks.boxes) {
        const int left = whole(box.leftPixels), top = whole(box.topPixels);
        fillBox(picture, left, top, whole(box.leftPixels + box.widthPixels) - left,
                whole(box.topPixels + box.heightPixels) - top, rgb(box.color));
    }
    const int dot = marks.dotPixels;
    std::vector<std::array<int, 4>> taken;  // left, top, right, bottom
    for (const PictureWords& words : marks.words) {
        const int wide = textWidth(words.text, dot), high = kGlyphHeight * dot;
        const double middleX = words.placePixels[0] + words.direction[0] * wide / 2;
        const double middleY = words.placePixels[1] + words.direction[1] * high / 2;
        const int left = whole(middleX - wide / 2.0), top = whole(middleY - high / 2.0);
        const std::array<int, 4> box{left - 2 * dot, top - dot, left + wide + 2 * dot, top + high + dot};
        if (std::ranges::any_of(taken, [&](const std::array<int, 4>& other) {
                return box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3];
            }))
            continue;
        taken.push_back(box);
        for (const int x : {-dot, 0, dot})
            for (const int y : {-dot, 0, dot})
                if (x != 0 || y != 0) drawText(picture, left + x, top + y, words.text, rgb(ground), dot);
        drawText(picture, left, top, words.text, rgb(words.color), dot);
    }
}

void writePng(const std::string& path, const RgbImage& image) {
    png_image png;
    std::memset(&png, 0, sizeof png);
    png.version = PNG_IMAGE_VERSION;
    png.width = png_uint_32(image.width);
    png.height = png_uint_32(image.height);
    png.format = PNG_FORMAT_RGB;
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
    std::string bytes(size, '\0');
    if (!png_image_write_to_memory(&png, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr)) {
        const std::string why = png.message;
        png_image_free(&png);
        throw IoError("can't write " + path + ": " + why);
    }
    bytes.resize(size);
    writeFileAtomically(path, bytes);
}

void writeSlicePng(const std::string& path, const ScalarImage& image, const PictureOptions& options) {
    writePng(path, drawPicture(image, options));
}

}  // namespace tessera
