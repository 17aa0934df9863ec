#pragma once

#include <charconv>
#include <cstdint>
#include <cstdlib>
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
        const std::string_view digits = found.starts_with('+') ? found.substr(1) : found;
        Number value{};
        const auto result = std::from_chars(digits.data(), digits.data() + digits.size(), value);
        const bool outOfRange = result.ec == std::errc::result_out_of_range;
        if (found.empty() || result.ptr != digits.data() + digits.size() ||
            (result.ec != std::errc() && !(outOfRange && std::is_floating_point_v<Number>)))
            fail(std::string("expected ") + expected + ", found '" + printable(found.substr(0, 24)) + "'");
        // from_chars leaves the value alone where it is too small or too large for a double.
        if (outOfRange) value = Number(std::strtod(std::string(digits).c_str(), nullptr));
        return value;
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
