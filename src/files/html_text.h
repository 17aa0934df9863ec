#pragma once

#include <string>
#include <string_view>

namespace tessera {

/// Any text, made safe between tags and in quotes of HTML and SVG; control characters become spaces.
std::string inHtml(std::string_view text);

}  // namespace tessera
