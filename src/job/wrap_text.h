#pragma once

#include <string>

#include "base/text.h"

namespace tessera {

/// Columns of text where nothing says how many there are.
inline constexpr std::size_t kUsualTextWidth = 80;

/// Columns that a text in UTF-8 takes: one a character.
std::size_t textWidth(const std::string& text);

/// At most `width` columns, at least 5: a longer text loses its middle, "velocity_mag...phase_2".
std::string shortened(const std::string& text, std::size_t width);
/// What the name of a field may take of a picture's title.
inline constexpr std::size_t kTitleNameColumns = 80;

/// Breaks a line at spaces so that it fits. A word that is longer stays whole.
/// @param indent of what continues it.
std::string wrapLine(const std::string& line, std::size_t width, std::size_t indent);
/// The same for every line of a text, continued four columns further right than it begins.
std::string wrapLines(const std::string& text, std::size_t width);

}  // namespace tessera
