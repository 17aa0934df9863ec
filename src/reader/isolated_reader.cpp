#include "reader/isolated_reader.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <new>
#include <optional>

#include "base/machine_memory.h"
#include "base/text.h"
#include "base/timer.h"
#include "mesh_files/raw_mesh.h"
#include "reader/mesh_packet.h"
#include "reader/reader_limits.h"
#include "reader/reader_process.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kTickMs = 50;
constexpr double kMostSeconds = 10 * 86400;  // that a reader may ask for

std::string inMiB(std::int64_t bytes) {
    return std::to_string((bytes + (1 << 20) - 1) >> 20) + " MiB";
}

std::string inSeconds(double seconds) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g s", seconds);
    return text;
}

/// One request and its answer: the request goes and the report arrives piece by piece.
class IsolatedReading {
  public:
    /// @param given as the caller gave them: 0 for the usual ones.
    IsolatedReading(ReaderRequest request, std::string name, const IsolationLimits& given,
                    const Execution& execution)
        : request_(std::move(request)), name_(std::move(name)), given_(given), execution_(execution) {
        request_.parent = ::getpid();
        request_.memoryBytes = given.memoryBytes > 0 ? readingShare(given.memoryBytes) : 0;
        request_.threads = execution.threads;
        HeadWriter words;
        words.put(requestWords(request_));
        const std::string text = words.take();
        words.put(std::uint64_t(text.size()));
        sent_ = words.take() + text;
    }

    void run(const IsolatedReader& reader, const TakeAnswer& take);

  private:
    void setLimits(const IsolationLimits& usual);
    void takeLimits(const ReaderProcess& process);
    void takeAnswer(ReaderProcess& process, const TakeAnswer& take);
    void takeStage();
    bool makesTetrahedra() const { return stage_ == Stage::tetrahedralizing; }
    std::string doer() const { return makesTetrahedra() ? ": TetGen " : ": the reader "; }
    std::string work() const { return makesTetrahedra() ? ": making tetrahedra of it " : ": reading it "; }
    std::string suspicion() const;
    bool readQuickly(const std::string& executable, const TakeAnswer& take);
    bool awaitReport(ReaderProcess& process);
    void checkTimes(double spentMs, const ReaderProcess& process) const;
    void send(int descriptor);
    bool receive(int descriptor);
    bool isComplete() const;
    ReportStart start() const;
    std::int64_t mostHandedOver() const { return limits_.memoryBytes / kHandedOverShare; }
    [[noreturn]] void rethrow(ReaderOutcome outcome, const std::string& message) const;
    [[noreturn]] void failWithGarbage(const std::string& why) const;
    [[noreturn]] void failWithEnd(const ProcessEnd& end) const;

    ReaderRequest request_;
    std::string name_;  // for messages
    std::string sent_;  // the request
    std::size_t sentBytes_ = 0;
    IsolationLimits given_, usual_, limits_;
    const Execution& execution_;
    std::vector<std::byte> report_;
    std::string timeOption_;
    Stage stage_ = Stage::reading;  ///< what the process is at
};

/// What was given counts.
void IsolatedReading::setLimits(const IsolationLimits& usual) {
    limits_ = usual_ = usual;
    if (given_.memoryBytes > 0) limits_.memoryBytes = given_.memoryBytes;
    if (given_.seconds > 0) {
        limits_.seconds = given_.seconds;
        limits_.processorSeconds = std::numeric_limits<double>::infinity();
    }
    if (given_.processorSeconds > 0) limits_.processorSeconds = given_.processorSeconds;
}

ReportStart IsolatedReading::start() const {
    ReportStart start;
    std::memcpy(&start, report_.data(), sizeof start);
    return start;
}

std::string IsolatedReading::suspicion() const {
    return makesTetrahedra()
               ? "; its input hits a bug of that library, as parts that lie closer than 1e-8 of its size do"
               : "; the file is damaged, or hits a bug of the library that reads it";
}

void IsolatedReading::failWithGarbage(const std::string& why) const {
    throw InputError(name_ + doer() + "went wrong and handed over no sound " +
                     (request_.task == "mesh" ? "mesh" : "answer") + " (" + why + ")" + suspicion());
}

void IsolatedReading::failWithEnd(const ProcessEnd& end) const {
    if (end.byProcessorLimit) throw IoError(name_ + doer() + end.words);
    // Libraries crash where memory ends, too.
    if (end.bySignal && given_.memoryBytes > 0 && given_.memoryBytes < usual_.memoryBytes)
        throw InputError(name_ + doer() + end.words + "; the limit on memory given, " +
                         inMiB(given_.memoryBytes) + ", may be too low: for a file like this it would be " +
                         inMiB(usual_.memoryBytes));
    throw InputError(name_ + doer() + end.words + suspicion());
}

bool IsolatedReading::isComplete() const {
    if (report_.size() < sizeof(ReportStart)) return false;
    const ReportStart s = start();
    const std::uint64_t most =
        s.outcome == ReaderOutcome::answerFollows ? std::uint64_t(mostHandedOver()) : kLongestMessageBytes;
    if (s.magic != ReportStart::kMagic || s.outcome > ReaderOutcome::outOfMemory || s.bytes > most ||
        report_.size() - sizeof s > s.bytes)
        failWithGarbage("its report makes no sense");
    return report_.size() - sizeof s == s.bytes;
}

/// Gives what fits into the socket. A child that ended early is noticed by what it reports.
void IsolatedReading::send(int descriptor) {
    while (sentBytes_ < sent_.size()) {
        const ssize_t count =
            ::send(descriptor, sent_.data() + sentBytes_, sent_.size() - sentBytes_, MSG_NOSIGNAL);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0 && errno != EAGAIN) sentBytes_ = sent_.size();
        if (count < 0) return;
        sentBytes_ += std::size_t(count);
    }
}

/// Takes what there is in the socket. False when the child has closed it.
bool IsolatedReading::receive(int descriptor) {
    std::array<std::byte, 1 << 16> buffer;
    while (!isComplete()) {
        // No more than is missing: another report may follow.
        const std::size_t missing = report_.size() < sizeof(ReportStart)
                                        ? sizeof(ReportStart) - report_.size()
                                        : sizeof(ReportStart) + start().bytes - report_.size();
        const ssize_t count = ::read(descriptor, buffer.data(), std::min(buffer.size(), missing));
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) return errno == EAGAIN;
        if (count == 0) return false;
        report_.insert(report_.end(), buffer.begin(), buffer.begin() + count);
    }
    return true;
}

void IsolatedReading::checkTimes(double spentMs, const ReaderProcess& process) const {
    const std::string taken = name_ + work() + "took more than ";
    const std::string usual = ", the limit for a file like this; " + timeOption_ + " sets another";
    if (spentMs >= limits_.seconds * 1e3) {
        if (given_.seconds <= 0) throw InputError(taken + inSeconds(limits_.seconds) + usual);
        throw InputError(taken + inSeconds(limits_.seconds) +
                         ", the limit given; for a file like this it would be " +
                         inSeconds(usual_.processorSeconds) + " of processor time");
    }
    if (process.processorSeconds() >= limits_.processorSeconds)
        throw InputError(taken + inSeconds(limits_.processorSeconds) + " of processor time" +
                         (given_.processorSeconds > 0 ? ", the limit given" : usual));
}

/// The usual limits for this file, which the child has looked at by now. A wrong word of it is worth no more
/// than a file that declares as much.
void IsolatedReading::takeLimits(const ReaderProcess& process) {
    IsolationLimits usual;
    if (report_.size() != sizeof(ReportStart) + sizeof usual) failWithGarbage("its limits make no sense");
    std::memcpy(&usual, report_.data() + sizeof(ReportStart), sizeof usual);
    const auto isTime = [](double seconds) { return seconds > 0 && seconds <= kMostSeconds; };
    if (!(usual.memoryBytes > 0 && isTime(usual.seconds) && isTime(usual.processorSeconds)))
        failWithGarbage("its limits make no sense");
    setLimits(usual);
    limits_.memoryBytes = std::min(limits_.memoryBytes, std::max(given_.memoryBytes, defaultMemoryBytes()));
    if (given_.processorSeconds <= 0) limits_.processorSeconds += process.processorSeconds();
    report_.clear();
}

void IsolatedReading::takeStage() {
    std::uint64_t number = 0;
    if (report_.size() != sizeof(ReportStart) + sizeof number) failWithGarbage("its stage makes no sense");
    std::memcpy(&number, report_.data() + sizeof(ReportStart), sizeof number);
    if (number > std::uint64_t(Stage::tetrahedralizing)) failWithGarbage("its stage makes no sense");
    stage_ = Stage(number);
    report_.clear();
    execution_.report(stage_, 0, 1);
}

/// False when the child closed its end before its report was whole.
bool IsolatedReading::awaitReport(ReaderProcess& process) {
    setLimits(limitsToLook());
    report_.clear();
    sentBytes_ = 0;
    double spentMs = 0;
    Timer timer;
    bool hasLimits = false;
    while (true) {
        execution_.throwIfCancelled();
        send(process.reports());
        const bool open = receive(process.reports());
        if (isComplete() && start().outcome == ReaderOutcome::stage) takeStage();
        const bool isWhole = isComplete(), givesLimits = isWhole && start().outcome == ReaderOutcome::limits;
        if (givesLimits && hasLimits) failWithGarbage("it sets its limits twice");
        if (givesLimits) takeLimits(process);
        hasLimits = hasLimits || givesLimits;
        if (isWhole && !givesLimits) return true;
        if (!open) return false;
        // Time in which this process didn't run, stopped by Ctrl-Z say, isn't the reader's.
        spentMs += std::min(timer.restart(), 5.0 * kTickMs);
        checkTimes(spentMs, process);
        const double leftMs = limits_.seconds * 1e3 - spentMs;
        pollfd reports{process.reports(), short(POLLIN | (sentBytes_ < sent_.size() ? POLLOUT : 0)), 0};
        ::poll(&reports, 1, int(std::ceil(std::min(leftMs, double(kTickMs)))));
    }
}

void IsolatedReading::rethrow(ReaderOutcome outcome, const std::string& message) const {
    switch (outcome) {
        case ReaderOutcome::inputError:
        case ReaderOutcome::otherFormat:
            throw InputError(message);
        case ReaderOutcome::ioError:
            throw IoError(message);
        case ReaderOutcome::internalError:
            throw InternalError(message);
        case ReaderOutcome::overLimit:
            throw InputError(
                name_ + work() + "needs more than " + inMiB(limits_.memoryBytes) + " of memory, " +
                (given_.memoryBytes > 0
                     ? "the limit given; for a file like this it would be " + inMiB(usual_.memoryBytes)
                     : "the limit for a file like this; --max-memory sets another"));
        case ReaderOutcome::outOfMemory:
            throw std::bad_alloc();
        default:
            throw std::runtime_error(message);
    }
}

/// The answer, or the error, of a report that is whole.
void IsolatedReading::takeAnswer(ReaderProcess& process, const TakeAnswer& take) {
    process.end();  // before what it handed over is copied
    const ReportStart answer = start();
    const std::span<const std::byte> rest = std::span(report_).subspan(sizeof answer);
    try {
        if (answer.outcome == ReaderOutcome::answerFollows) return take(rest, mostHandedOver());
        if (answer.outcome == ReaderOutcome::answerInMemory)
            return take(SealedMemory(process.answer(), mostHandedOver()).bytes(), mostHandedOver());
    } catch (const DamagedPacket& damage) {
        failWithGarbage(damage.what());
    }
    rethrow(answer.outcome, messageLine({reinterpret_cast<const char*>(rest.data()), rest.size()}));
}

/// False when the program doesn't read this format, or can't be used: isn't one, is of another build, lacks a
/// library.
bool IsolatedReading::readQuickly(const std::string& executable, const TakeAnswer& take) {
    std::optional<ReaderProcess> process;
    try {
        process.emplace(executable, startWords(request_.parent));
    } catch (const IoError&) {
        return false;
    }
    if (!awaitReport(*process)) {
        const ProcessEnd end = process->describeEnd();
        if (end.bySignal) failWithEnd(end);
        return false;
    }
    if (start().outcome == ReaderOutcome::otherFormat) return false;
    takeAnswer(*process, take);
    return true;
}

void IsolatedReading::run(const IsolatedReader& reader, const TakeAnswer& take) {
    timeOption_ = reader.timeOption;
    if (!reader.quickExecutable.empty() && readQuickly(reader.quickExecutable, take)) return;
    std::vector<std::string> words = reader.arguments;
    for (std::string& word : startWords(request_.parent)) words.push_back(std::move(word));
    ReaderProcess process(reader.executable, words);
    if (!awaitReport(process)) failWithEnd(process.describeEnd());
    takeAnswer(process, take);
}

}  // namespace

std::string programBeside(const std::string& executable, const std::string& name) {
    namespace fs = std::filesystem;
    std::error_code error;
    const fs::path directory = fs::canonical(executable, error).parent_path();
    for (const char* place : {"", TESSERA_READER_FROM_BINDIR}) {
        const fs::path candidate = directory / place / name;
        if (!error && fs::is_regular_file(candidate, error) && ::access(candidate.c_str(), X_OK) == 0)
            return candidate.string();
    }
    return {};
}

std::string quickReaderBeside(const std::string& executable) {
    return programBeside(executable, "tessera_read_mesh");
}

void askReader(const IsolatedReader& reader, ReaderRequest request, const std::string& name,
               const IsolationLimits& limits, const Execution& execution, const TakeAnswer& take) {
    execution.throwIfCancelled();
    IsolatedReading(std::move(request), name, limits, execution).run(reader, take);
}

MeshFile readMeshIsolated(const IsolatedReader& reader, const std::string& path, const ReadOptions& options,
                          const IsolationLimits& limits, const Execution& execution) {
    ReaderRequest request;
    request.path = path;
    request.options = options;
    return askForMesh(reader, std::move(request), limits, execution);
}

MeshFile askForMesh(const IsolatedReader& reader, ReaderRequest request, const IsolationLimits& limits,
                    const Execution& execution) {
    const std::string name = meshName(request.path, request.options);
    MeshFile file;
    askReader(reader, std::move(request), name, limits, execution,
              [&](std::span<const std::byte> packet, std::int64_t) {
                  const std::int64_t heldBytes = residentMemoryBytes();
                  file = unpackMesh(packet, execution);
                  file.readPeakBytes += heldBytes;
              });
    return file;
}

}  // namespace tessera
