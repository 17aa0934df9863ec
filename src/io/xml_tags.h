#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace tessera {

/// One start tag: <name attributes>.
struct XmlTag {
    std::size_t begin = 0;  ///< byte of '<'
    std::size_t end = 0;    ///< byte behind '>'
    std::string_view name;
    std::string_view text;  ///< from the name to before '>'
};

/// Start tags of XML text in their order, comments and declarations left out; each byte is looked at once.
class XmlTags {
  public:
    XmlTags(std::string_view text, std::size_t from) : text_(text), at_(from) {}
    /// Nothing when there is no further whole tag.
    std::optional<XmlTag> next();

  private:
    std::string_view text_;
    std::size_t at_;
};

/// Value of an attribute in a tag's text.
std::optional<std::string_view> attributeOf(std::string_view tag, std::string_view name);

/// The start of a text in quotes, for messages.
std::string quoted(std::string_view text);

}  // namespace tessera
