#include "job/focus_path.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <string_view>

#include "files/input_file.h"
#include "job/wrap_text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kShownOfLine = 60;

bool isBetweenNumbers(char c) {
    return c == ' ' || c == '\t' || c == '\r';
}

constexpr std::size_t kMostBytes = 64 << 20;

/// Three finite numbers with spaces between, or at most one comma; false for anything else.
bool parsePlace(std::string_view line, Vec3d& place) {
    std::size_t at = 0;
    const auto skipSpaces = [&] {
        while (at < line.size() && isBetweenNumbers(line[at])) ++at;
    };
    for (int axis = 0; axis < 3; ++axis) {
        const std::size_t gapBegin = at;
        skipSpaces();
        if (axis > 0 && at < line.size() && line[at] == ',') {
            ++at;
            skipSpaces();
        }
        if (axis > 0 && at == gapBegin) return false;
        const auto [end, failure] = std::from_chars(line.data() + at, line.data() + line.size(), place[axis]);
        if (failure != std::errc{} || !std::isfinite(place[axis])) return false;
        at = std::size_t(end - line.data());
    }
    skipSpaces();
    return at == line.size();
}

}  // namespace

std::vector<Vec3d> readFocusPath(const std::string& path) {
    const std::string text = readWholeFile(path, kMostBytes);
    std::vector<Vec3d> places;
    std::size_t number = 0;
    for (std::size_t begin = 0; begin < text.size();) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        const std::string_view whole = std::string_view(text).substr(begin, end - begin);
        const std::string_view line = whole.substr(0, whole.find('#'));
        begin = end + 1;
        ++number;
        if (line.find_first_not_of(" \t\r") == std::string_view::npos) continue;
        Vec3d place{0};
        if (!parsePlace(line, place))
            throw InputError(fmt::format("{}, line {}: expected three numbers x y z, got '{}'", path, number,
                                         shortened(singleLine(std::string(line)), kShownOfLine)));
        places.push_back(place);
    }
    if (places.empty()) throw InputError(fmt::format("{}: holds no place (a line x y z each)", path));
    return places;
}

}  // namespace tessera
