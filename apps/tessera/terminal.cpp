#include "terminal.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <string_view>

#include "job/wrap_text.h"

namespace tessera {

namespace {

constexpr int kNarrowest = 40, kWidest = 1000;

}  // namespace

int terminalWidth(int descriptor) {
    winsize size{};
    if (::ioctl(descriptor, TIOCGWINSZ, &size) == 0 && size.ws_col > 0)
        return std::clamp(int(size.ws_col), kNarrowest, kWidest);
    int columns = 0;
    if (const char* text = std::getenv("COLUMNS"))
        std::from_chars(text, text + std::string_view(text).size(), columns);
    return columns > 0 ? std::clamp(columns, kNarrowest, kWidest) : int(kUsualTextWidth);
}

int outputWidth() {
    return ::isatty(STDOUT_FILENO) == 1 ? terminalWidth(STDOUT_FILENO) : int(kUsualTextWidth);
}

}  // namespace tessera
