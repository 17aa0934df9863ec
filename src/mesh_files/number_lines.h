#pragma once

#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include "tessera/error.h"

namespace tessera {

/// Text that stands in memory, and what messages call it.
struct NamedText {
    std::string name;
    std::string_view bytes;
};

/// Bytes that a terminal can't show as they are, as \xNN.
std::string printable(std::string_view word);

/// The number that a whole word is; none where it isn't one of the type. Numbers that are too small or too
/// large for a double become 0 or infinite.
template <class Number>
std::optional<Number> numberOf(std::string_view word) {
    if (word.starts_with('+')) word.remove_prefix(1);
    Number value{};
    const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
    const bool outOfRange = result.ec == std::errc::result_out_of_range;
    if (result.ptr != word.data() + word.size() || word.empty() ||
        (result.ec != std::errc() && !(outOfRange && std::is_floating_point_v<Number>)))
        return std::nullopt;
    // from_chars leaves the value alone then.
    if (outOfRange) value = Number(std::strtod(std::string(word).c_str(), nullptr));
    return value;
}

inline constexpr const char* kBlanksAndCommas = " \t\r,";
inline constexpr const char* kOnlyBlanks = " \t\r";

/// Numbers and words of a text file, line by line; '#' starts a comment, empty lines don't count.
class NumberLines {
  public:
    explicit NumberLines(const NamedText& text, const char* separators = kBlanksAndCommas)
        : name_(text.name), bytes_(text.bytes.size()), rest_(text.bytes), separators_(separators) {
        if (rest_.starts_with("\xef\xbb\xbf")) rest_.remove_prefix(3);
    }

    /// Moves to the next line with content. Throws InputError when there is none.
    void next(const char* expected);
    /// The same; false when there is none.
    bool tryNext();
    bool atEnd();
    /// The next word; empty at the line's end.
    std::string_view word();

    /// Throws InputError with file and line when the next word isn't a number of the type.
    template <class Number>
    Number read(const char* expected) {
        const std::string_view found = word();
        const std::optional<Number> number = numberOf<Number>(found);
        if (!number)
            fail(std::string("expected ") + expected + ", found '" + printable(found.substr(0, 24)) + "'");
        return *number;
    }
    /// A count of items. @param lineBytes of the shortest line that one can have; the last one needs no end
    /// of line.
    std::int64_t readCount(const char* what, double lineBytes);

    [[noreturn]] void fail(const std::string& why) const;

  private:
    void skipSpaces() { line_.remove_prefix(std::min(line_.find_first_not_of(separators_), line_.size())); }

    std::string name_;
    std::size_t bytes_;
    std::string_view rest_;
    std::string_view line_;
    const char* separators_;
    std::int64_t lineNumber_ = 0;
};

}  // namespace tessera
