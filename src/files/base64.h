#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace tessera {

/// Bytes as text (RFC 4648, section 4), with padding and without line breaks.
std::string encodeBase64(std::string_view bytes);
/// None when the text isn't what encodeBase64 gives for some bytes.
std::optional<std::string> decodeBase64(std::string_view text);

}  // namespace tessera
