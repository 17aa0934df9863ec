#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "files/input_file.h"

namespace tessera {

/// One start tag: <name attributes>.
struct XmlTag {
    std::size_t begin = 0;  ///< byte of '<'
    std::size_t end = 0;    ///< byte behind '>'
    std::string text;       ///< from the name to before '>'
    std::string_view name() const;
};

/// Start tags of an XML file in their order; comments, instructions and character data are left out.
class XmlTags {
  public:
    /// @param end tags begin before this byte.
    XmlTags(InputFile& file, std::size_t from, std::size_t end) : file_(file), at_(from), end_(end) {}
    /// Nothing when there is no further whole tag. Throws InputError for a tag of more than a mebibyte,
    /// and for a declaration of types or entities: then the markup isn't what it looks like.
    std::optional<XmlTag> next();

  private:
    std::size_t behind(std::string_view word, std::size_t from);
    std::size_t closeOf(std::size_t begin);

    InputFile& file_;
    std::size_t at_, end_;
};

/// Throws the InputError of XmlTags::next for a declaration.
[[noreturn]] void refuseDeclaration(const std::string& path, std::size_t byte);

/// Value of an attribute in a tag's text, which begins with the tag's name.
std::optional<std::string_view> attributeOf(std::string_view tag, std::string_view name);

/// An attribute's value as it is meant: &amp; and the other four entities of XML, &#38; and &#x26; become
/// characters, in UTF-8. Whatever else an '&' begins stays as it is.
std::string decodeEntities(std::string_view text);

/// The start of a text in quotes, for messages.
std::string quoted(std::string_view text);

}  // namespace tessera
