#include "benchmark/peer_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/text.h"
#include "base/timer.h"
#include "files/json_parse.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr const char* kPeerTask = "of a peer";
constexpr int kPeerTickMs = 50;
constexpr std::size_t kLongestLine = 65536;
constexpr std::streamoff kLogTail = 4096;
/// A peer's clock may differ from ours a little.
constexpr double kClockShare = 1.01, kClockMs = 1;

constexpr const char* kExpectedTitle = R"(a line such as {"peer": "NAME VERSION"} when it has read the mesh)";
constexpr const char* kExpectedAnswer = R"(a line such as {"ms": 12.3} when it has sampled)";

/// Socket 3 becomes its standard input and output, file 4 its standard error. "exec", so that the peer itself
/// is what is waited for and killed.
std::string shellLine(const std::string& command) {
    return "exec " + command + R"( "$0" <&3 >&3 2>&4 3>&- 4>&-)";
}

/// The last line of a file that has something in it; empty where there is none.
std::string lastLineOf(const std::string& path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    const std::streamoff size = file ? std::streamoff(file.tellg()) : 0;
    std::string tail(std::size_t(std::min(size, kLogTail)), ' ');
    file.seekg(size - std::streamoff(tail.size()));
    file.read(tail.data(), std::streamsize(tail.size()));
    const std::size_t end = tail.find_last_not_of(" \t\r\n");
    if (!file || end == std::string::npos) return {};
    const std::size_t before = tail.find_last_of('\n', end);
    const std::size_t begin = before == std::string::npos ? 0 : before + 1;
    return messageLine(tail.substr(begin, end + 1 - begin));
}

}  // namespace

PeerProcess::PeerProcess(const PeerCommand& peer, const std::string& meshPath, std::string logPath)
    : peer_(peer), logPath_(std::move(logPath)) {
    start(meshPath);
    const nlohmann::ordered_json line =
        parse(exchange({}, kExpectedTitle, {.threads = 0, .cancel = peer_.cancel}), kExpectedTitle);
    const auto title = line.find("peer");
    if (title == line.end() || !title->is_string() || title->get<std::string>().empty())
        fail(kExpectedTitle, "it said " + line.dump());
    title_ = messageLine(title->get<std::string>());
}

PeerProcess::~PeerProcess() {
    socket_.close();
    if (child_) child_->describeEnd();
}

void PeerProcess::start(const std::string& meshPath) {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
        failToStart(kPeerTask, "socket", errno);
    socket_ = Descriptor(ends[0]);
    const Descriptor childEnd(ends[1]);
    if (::fcntl(socket_.get(), F_SETFL, O_NONBLOCK) != 0) failToStart(kPeerTask, "socket", errno);
    const Descriptor log(::open(logPath_.c_str(), O_CREAT | O_WRONLY | O_APPEND | O_CLOEXEC, 0600));
    if (log.get() < 0) failToStart(kPeerTask, logPath_, errno);
    child_.emplace(ChildStart{kPeerTask,
                              "/bin/sh",
                              {"-c", shellLine(peer_.command), meshPath},
                              {childEnd.get(), log.get()},
                              {},
                              true});
}

double PeerProcess::ask(const nlohmann::ordered_json& request, const Execution& execution) {
    if (!failure_.empty()) throw IoError(failure_);
    if (!received_.empty()) fail("silence until the next request", "it said " + received_);
    const Timer timer;
    const std::string text =
        exchange(request.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n",
                 kExpectedAnswer, execution);
    const double elapsedMs = timer.elapsedMs();
    const nlohmann::ordered_json line = parse(text, kExpectedAnswer);
    if (const auto error = line.find("error"); error != line.end())
        throw IoError(
            sentence("samples", "it answered with the error \"" +
                                    (error->is_string() ? error->get<std::string>() : error->dump()) + "\"") +
            lastWords());
    const auto ms = line.find("ms");
    if (ms == line.end()) return elapsedMs;
    const double told = ms->is_number() ? ms->get<double>() : -1;
    if (!(told >= 0) || !std::isfinite(told)) fail(kExpectedAnswer, "it said " + text);
    if (told > elapsedMs * kClockShare + kClockMs)
        fail("\"ms\" within the " + shortNumber(elapsedMs) + " ms that its answer took", "it said " + text);
    return told;
}

std::string PeerProcess::sentence(const std::string& expected, const std::string& came) const {
    return "the peer " + peer_.name + ": expected " + expected + ", but " + messageLine(came);
}

std::string PeerProcess::lastWords() const {
    const std::string last = lastLineOf(logPath_);
    return last.empty() ? last : "; its standard error ends with \"" + last + "\"";
}

void PeerProcess::fail(const std::string& expected, const std::string& came) {
    // Stopped first: it may be about to say more.
    stop(sentence(expected, came));
    failure_ += lastWords();
    throw IoError(failure_);
}

void PeerProcess::stop(const std::string& why) {
    failure_ = why;
    child_.reset();
    socket_.close();
}

nlohmann::ordered_json PeerProcess::parse(const std::string& line, const std::string& expected) {
    nlohmann::ordered_json json;
    try {
        json = parseJson<nlohmann::ordered_json>(line);
    } catch (const std::exception&) {
        // Told as what isn't an object.
    }
    if (!json.is_object()) fail(expected, "it said " + line);
    return json;
}

/// Sends text and waits for a line.
std::string PeerProcess::exchange(std::string unsent, const std::string& expected,
                                  const Execution& execution) {
    for (const Timer timer;;) {
        if (const std::optional<std::string> line = takeLine(expected)) return *line;
        try {
            execution.throwIfCancelled();
        } catch (const Cancelled&) {
            stop("the peer " + peer_.name + " was stopped while it sampled");
            throw;
        }
        if (timer.elapsedMs() > peer_.timeoutMs)
            fail(expected, "nothing came within " + shortNumber(peer_.timeoutMs / 1000) + " s");
        pollfd socket{socket_.get(), short(POLLIN | (unsent.empty() ? 0 : POLLOUT)), 0};
        const int ready = ::poll(&socket, 1, kPeerTickMs);
        if (ready > 0) {
            send(unsent);
            receive(expected);
        } else if (ready == 0) {
            // One that ended may have left others that hold its end of the socket.
            if (const std::optional<ProcessEnd> end = child_->reap()) fail(expected, "it " + end->words);
        }
    }
}

/// As much as the socket takes. A peer that has gone is noticed by receive().
void PeerProcess::send(std::string& unsent) {
    if (unsent.empty()) return;
    const ssize_t sent = ::send(socket_.get(), unsent.data(), unsent.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent > 0) unsent.erase(0, std::size_t(sent));
}

void PeerProcess::receive(const std::string& expected) {
    std::array<char, 4096> bytes;
    const ssize_t count = ::recv(socket_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (count > 0) received_.append(bytes.data(), std::size_t(count));
    if (count > 0 || (count < 0 && (errno == EAGAIN || errno == EINTR))) return;
    fail(expected, "it " + child_->describeEnd().words);
}

std::optional<std::string> PeerProcess::takeLine(const std::string& expected) {
    const std::size_t end = received_.find('\n');
    if (end == std::string::npos && received_.size() > kLongestLine)
        fail(expected, "it said more than " + std::to_string(kLongestLine) + " bytes without a line's end");
    if (end == std::string::npos) return std::nullopt;
    std::string line = received_.substr(0, end);
    received_.erase(0, end + 1);
    return line;
}

}  // namespace tessera
