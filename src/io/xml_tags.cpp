#include "io/xml_tags.h"

#include <algorithm>

namespace tessera {

namespace {

constexpr std::string_view kSpaces = " \t\r\n";
constexpr std::size_t kQuotedCharacters = 24;

/// Byte behind `end`, or that behind the text.
std::size_t behind(std::string_view text, std::string_view end, std::size_t from) {
    const std::size_t at = text.find(end, from);
    return at == std::string_view::npos ? text.size() : at + end.size();
}

}  // namespace

std::optional<XmlTag> XmlTags::next() {
    while (true) {
        const std::size_t begin = text_.find('<', at_);
        if (begin == std::string_view::npos || begin + 1 >= text_.size()) return std::nullopt;
        const std::string_view rest = text_.substr(begin);
        if (rest.starts_with("<!--")) {
            at_ = behind(text_, "-->", begin);
            continue;
        }
        if (rest[1] == '!' || rest[1] == '?' || rest[1] == '/') {
            at_ = behind(text_, ">", begin);
            continue;
        }
        std::size_t end = text_.find_first_of(">\"'", begin);
        while (end != std::string_view::npos && text_[end] != '>') {
            const std::size_t close = text_.find(text_[end], end + 1);
            end = close == std::string_view::npos ? close : text_.find_first_of(">\"'", close + 1);
        }
        if (end == std::string_view::npos) return std::nullopt;
        at_ = end + 1;
        XmlTag tag{begin, at_, {}, text_.substr(begin + 1, end - begin - 1)};
        tag.name = tag.text.substr(0, std::min(tag.text.find_first_of(" \t\r\n/"), tag.text.size()));
        return tag;
    }
}

std::optional<std::string_view> attributeOf(std::string_view tag, std::string_view name) {
    for (std::size_t at = tag.find(name); at != std::string_view::npos; at = tag.find(name, at + 1)) {
        if (at == 0 || kSpaces.find(tag[at - 1]) == std::string_view::npos) continue;
        std::size_t next = tag.find_first_not_of(kSpaces, at + name.size());
        if (next == std::string_view::npos || tag[next] != '=') continue;
        next = tag.find_first_not_of(kSpaces, next + 1);
        if (next == std::string_view::npos || (tag[next] != '"' && tag[next] != '\'')) continue;
        const std::size_t close = tag.find(tag[next], next + 1);
        if (close == std::string_view::npos) return std::nullopt;
        return tag.substr(next + 1, close - next - 1);
    }
    return std::nullopt;
}

std::string quoted(std::string_view text) {
    std::string result = "'";
    for (const char c : text.substr(0, kQuotedCharacters)) result += c >= ' ' && c < 127 ? c : '?';
    return result + (text.size() > kQuotedCharacters ? "...'" : "'");
}

}  // namespace tessera
