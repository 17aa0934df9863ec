#include "files/xml_tags.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>

#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::string_view kSpaces = " \t\r\n";
constexpr std::size_t kQuotedCharacters = 24;

constexpr std::size_t kLongestTag = 1 << 20;

struct Entity {
    std::string_view name;
    char character;
};
constexpr std::array<Entity, 5> kEntities{
    {{"amp", '&'}, {"lt", '<'}, {"gt", '>'}, {"quot", '"'}, {"apos", '\''}}};

/// Nothing for a number that is no character of XML.
std::string utf8(std::uint32_t code) {
    const bool isCharacter =
        code >= ' ' ? code < 0xd800 || (code > 0xdfff && code <= 0x10ffff && code != 0xfffe && code != 0xffff)
                    : code == '\t' || code == '\n' || code == '\r';
    if (!isCharacter) return {};
    if (code < 0x80) return {char(code)};
    const auto rest = [&](int shift) { return char(0x80 | (code >> shift & 0x3f)); };
    if (code < 0x800) return {char(0xc0 | code >> 6), rest(0)};
    if (code < 0x10000) return {char(0xe0 | code >> 12), rest(6), rest(0)};
    return {char(0xf0 | code >> 18), rest(12), rest(6), rest(0)};
}

/// What stands between '&' and ';'. Empty when it means no character.
std::string decodeEntity(std::string_view name) {
    for (const Entity& entity : kEntities)
        if (name == entity.name) return {entity.character};
    if (!name.starts_with('#')) return {};
    const bool isHex = name.starts_with("#x");
    name.remove_prefix(isHex ? 2 : 1);
    std::uint32_t code = 0;
    const auto result = std::from_chars(name.data(), name.data() + name.size(), code, isHex ? 16 : 10);
    return result.ec == std::errc() && result.ptr == name.data() + name.size() ? utf8(code) : std::string();
}

}  // namespace

std::string_view XmlTag::name() const {
    return std::string_view(text).substr(0, text.find_first_of(" \t\r\n/"));
}

/// Byte behind `word`, or that behind the file.
std::size_t XmlTags::behind(std::string_view word, std::size_t from) {
    const std::size_t at = file_.find(word, from);
    return at == InputFile::npos ? file_.size() : at + word.size();
}

/// Byte of the '>' that ends the tag; one in quotes doesn't.
std::size_t XmlTags::closeOf(std::size_t begin) {
    std::size_t at = file_.findFirstOf(">\"'", begin);
    while (at != InputFile::npos) {
        const char found = file_.bytesFrom(at).front();
        if (found == '>') return at;
        at = file_.find({&found, 1}, at + 1);
        if (at != InputFile::npos) at = file_.findFirstOf(">\"'", at + 1);
    }
    return at;
}

std::optional<XmlTag> XmlTags::next() {
    while (true) {
        const std::size_t begin = at_ < end_ ? file_.find("<", at_) : InputFile::npos;
        if (begin >= end_ || begin + 1 >= file_.size()) return std::nullopt;
        const std::string_view head = file_.bytesFrom(begin, 4);
        if (head.starts_with("<!--")) {
            at_ = behind("-->", begin);
            continue;
        }
        if (head.starts_with("<?") || head.starts_with("</")) {
            at_ = behind(head[1] == '?' ? "?>" : ">", begin);
            continue;
        }
        if (head[1] == '!') {
            if (!file_.bytesFrom(begin, 9).starts_with("<![CDATA[")) refuseDeclaration(file_.path(), begin);
            at_ = behind("]]>", begin);
            continue;
        }
        const std::size_t close = closeOf(begin);
        if (close == InputFile::npos) return std::nullopt;
        if (close - begin > kLongestTag)
            throw InputError(file_.path() + ": damaged: byte " + std::to_string(begin) +
                             " begins a tag of more than " + std::to_string(kLongestTag) + " bytes");
        at_ = close + 1;
        return XmlTag{begin, at_, file_.copy(begin + 1, close - begin - 1)};
    }
}

void refuseDeclaration(const std::string& path, std::size_t byte) {
    throw InputError(path + ": byte " + std::to_string(byte) +
                     ": a declaration of a document's type or its entities; VTK's files have none");
}

std::optional<std::string_view> attributeOf(std::string_view tag, std::string_view name) {
    std::size_t at = tag.find_first_of(kSpaces);
    while (true) {
        at = std::min(tag.find_first_not_of(kSpaces, at), tag.size());
        const std::size_t equals = tag.find('=', at);
        const std::size_t open = tag.find_first_not_of(kSpaces, std::min(equals, tag.size() - 1) + 1);
        if (equals == std::string_view::npos || open == std::string_view::npos) return std::nullopt;
        const std::size_t close =
            tag[open] == '"' || tag[open] == '\'' ? tag.find(tag[open], open + 1) : std::string_view::npos;
        if (close == std::string_view::npos) return std::nullopt;
        std::string_view found = tag.substr(at, equals - at);
        found = found.substr(0, found.find_last_not_of(kSpaces) + 1);
        if (found == name) return tag.substr(open + 1, close - open - 1);
        at = close + 1;
    }
}

std::string decodeEntities(std::string_view text) {
    std::string result;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t end = text[at] == '&' ? text.find_first_of("&;", at + 1) : std::string_view::npos;
        std::string character;
        if (end != std::string_view::npos && text[end] == ';')
            character = decodeEntity(text.substr(at + 1, end - at - 1));
        result += character.empty() ? std::string{text[at]} : character;
        at = character.empty() ? at + 1 : end + 1;
    }
    return result;
}

std::string quoted(std::string_view text) {
    std::string result = "'";
    for (const char c : text.substr(0, kQuotedCharacters)) result += c >= ' ' && c < 127 ? c : '?';
    return result + (text.size() > kQuotedCharacters ? "...'" : "'");
}

}  // namespace tessera
