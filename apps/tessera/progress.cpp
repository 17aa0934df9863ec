#include "progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <string_view>
#include <system_error>

#include "terminal.h"

namespace tessera {

namespace {

constexpr std::chrono::milliseconds kRedraw(100);
constexpr double kSilentMs = 250;    // shorter runs draw nothing
constexpr double kNoGuessMs = 2000;  // from the start: what is left isn't told yet
constexpr std::size_t kWordsWidth = 20, kWidestBar = 40, kNarrowestBar = 10;

std::mutex lineMutex;
bool lineDrawn = false;

const char* wordsOf(Stage stage) {
    switch (stage) {
        case Stage::reading:
            return "reading the mesh";
        case Stage::tetrahedralizing:
            return "making tetrahedra";
        case Stage::repairing:
            return "repairing the mesh";
        case Stage::planning:
            return "planning";
        case Stage::sampling:
            return "sampling";
        case Stage::checking:
        case Stage::measuring:
            return "measuring the error";
        case Stage::comparing:
            return "comparing";
        case Stage::extending:
            return "extending the edges";
        case Stage::writing:
            return "writing";
    }
    return "";
}

std::string leftText(double ms) {
    const double seconds = ms / 1000;
    if (seconds < 0) return {};
    if (seconds < 20) return fmt::format("{:.0f} s left", std::max(1.0, std::ceil(seconds)));
    if (seconds < 90) return fmt::format("{:.0f} s left", 5 * std::ceil(seconds / 5));
    if (seconds < 90 * 60) return fmt::format("{:.0f} min left", std::ceil(seconds / 60));
    return fmt::format("{:.1f} h left", seconds / 3600);
}

void wipe() {
    if (!lineDrawn) return;
    std::fputs("\r\x1b[K", stderr);
    std::fflush(stderr);
    lineDrawn = false;
}

bool canDraw() {
    const char* terminal = std::getenv("TERM");
    return ::isatty(STDERR_FILENO) == 1 && !(terminal && std::string_view(terminal) == "dumb");
}

}  // namespace

std::unique_lock<std::mutex> pauseProgress() {
    std::unique_lock lock(lineMutex);
    wipe();
    return lock;
}

std::string progressText(const ProgressState& state, std::size_t width) {
    std::string front = state.step.empty() ? std::string() : state.step + ": ";
    front += fmt::format("{:<{}}", wordsOf(state.stage), kWordsWidth);
    // 100 % is the end, and that is when the line is gone.
    const std::string percent = fmt::format("{:3.0f} %", std::floor(std::min(state.share, 0.99) * 100));
    const std::string left = fmt::format("{:>12}", leftText(state.leftMs));
    const std::size_t room = width - 1;
    const std::size_t taken = front.size() + percent.size() + left.size() + 4;  // brackets and spaces
    std::string line = front;
    if (taken + kNarrowestBar <= room) {
        const std::size_t bar = std::min(kWidestBar, room - taken);
        const auto filled = std::size_t(state.share * double(bar));
        line += fmt::format("[{:#<{}}{:.<{}}] ", "", filled, "", bar - filled);
    }
    line += percent + " " + left;
    line.erase(line.find_last_not_of(' ') + 1);
    return line.substr(0, room);
}

ProgressLine::ProgressLine(bool wanted)
    : enabled_(wanted && canDraw()), run_([this] { return clock_.elapsedMs(); }) {
    if (!enabled_) return;
    try {
        drawer_ = std::thread([this] { drawAgain(); });
    } catch (const std::system_error&) {
        enabled_ = false;  // no thread to be had: the run itself is worth more
    }
}

ProgressLine::~ProgressLine() {
    {
        const std::lock_guard lock(stopMutex_);
        stop_ = true;
    }
    stopped_.notify_all();
    if (drawer_.joinable()) drawer_.join();
    const auto pause = pauseProgress();
}

void ProgressLine::drawAgain() {
    std::unique_lock lock(stopMutex_);
    try {
        while (!stopped_.wait_for(lock, kRedraw, [this] { return stop_; })) draw();
    } catch (const std::bad_alloc&) {
        // Whoever works will notice too; a line is no reason to end the run.
    }
}

void ProgressLine::draw() {
    const double elapsedMs = clock_.elapsedMs();
    if (elapsedMs < kSilentMs) return;
    const std::lock_guard lock(lineMutex);
    ProgressState state = run_.state();
    if (!state.hasBegun) return;
    if (elapsedMs < kNoGuessMs) state.leftMs = -1;
    const auto width = std::size_t(terminalWidth(STDERR_FILENO));
    const std::string line = fmt::format("\r{}\x1b[K", progressText(state, width));
    std::fputs(line.c_str(), stderr);
    std::fflush(stderr);
    lineDrawn = true;
}

}  // namespace tessera
