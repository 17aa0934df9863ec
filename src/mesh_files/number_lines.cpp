#include "mesh_files/number_lines.h"

#include <algorithm>

namespace tessera {

std::string printable(std::string_view word) {
    constexpr char kDigits[] = "0123456789abcdef";
    std::string text;
    for (const char c : word) {
        const auto byte = static_cast<unsigned char>(c);
        if (byte >= 0x20 && byte < 0x7f)
            text += c;
        else
            text += {'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15]};
    }
    return text;
}

bool NumberLines::tryNext() {
    while (!rest_.empty()) {
        ++lineNumber_;
        const std::size_t end = std::min(rest_.find('\n'), rest_.size());
        line_ = rest_.substr(0, end);
        rest_.remove_prefix(std::min(end + 1, rest_.size()));
        line_ = line_.substr(0, line_.find('#'));
        skipSpaces();
        if (!line_.empty()) return true;
    }
    return false;
}

void NumberLines::next(const char* expected) {
    if (tryNext()) return;
    throw InputError(name_ + ": ends after line " + std::to_string(lineNumber_) + ", expected " + expected);
}

bool NumberLines::atEnd() {
    skipSpaces();
    return line_.empty();
}

std::string_view NumberLines::word() {
    skipSpaces();
    const std::string_view found = line_.substr(0, line_.find_first_of(separators_));
    line_.remove_prefix(found.size());
    return found;
}

std::int64_t NumberLines::readCount(const char* what, double lineBytes) {
    const auto count = read<std::int64_t>(what);
    if (count < 0 || double(count) * lineBytes > double(bytes_) + 1)
        fail("declares " + std::to_string(count) + " as " + what + ", the file has " +
             std::to_string(bytes_) + " bytes");
    return count;
}

void NumberLines::fail(const std::string& why) const {
    throw InputError(name_ + ": line " + std::to_string(lineNumber_) + ": " + why);
}

}  // namespace tessera
