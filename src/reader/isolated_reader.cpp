#include "reader/isolated_reader.h"

#include <poll.h>
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

#include "base/timer.h"
#include "mesh_files/raw_mesh.h"
#include "reader/mesh_packet.h"
#include "reader/reader_limits.h"
#include "reader/reader_process.h"
#include "reader/reader_report.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kTickMs = 50;
constexpr std::uint64_t kLongestMessage = 1 << 20;

std::string inMiB(std::int64_t bytes) {
    return std::to_string((bytes + (1 << 20) - 1) >> 20) + " MiB";
}

std::string inSeconds(double seconds) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g s", seconds);
    return text;
}

/// One reading by a child: its report arrives piece by piece.
class IsolatedReading {
  public:
    /// @param given as the caller gave them: 0 for the usual ones.
    IsolatedReading(const std::string& path, const ReadOptions& options, const IsolationLimits& given,
                    const Execution& execution)
        : path_(path),
          options_(options),
          name_(meshName(path, options)),
          given_(given),
          usual_(defaultLimits(path, options.otherParts)),
          limits_(usual_),
          execution_(execution) {
        if (given.memoryBytes > 0) limits_.memoryBytes = given.memoryBytes;
        if (given.seconds > 0) {
            limits_.seconds = given.seconds;
            limits_.processorSeconds = std::numeric_limits<double>::infinity();
        }
        if (given.processorSeconds > 0) limits_.processorSeconds = given.processorSeconds;
    }

    MeshFile run(const IsolatedReader& reader);

  private:
    MeshFile takeMesh(ReaderProcess& process);
    std::optional<MeshFile> readQuickly(const std::string& executable,
                                        const std::vector<std::string>& request);
    bool awaitReport(ReaderProcess& process);
    void checkTimes(double spentMs, const ReaderProcess& process) const;
    bool receive(int descriptor);
    bool isComplete() const;
    ReportStart start() const;
    [[noreturn]] void rethrow(ReaderOutcome outcome, const std::string& message) const;
    [[noreturn]] void failWithGarbage(const std::string& why) const;
    [[noreturn]] void failWithEnd(const ProcessEnd& end) const;

    const std::string& path_;
    const ReadOptions& options_;
    std::string name_;  // for messages
    IsolationLimits given_, usual_, limits_;
    const Execution& execution_;
    std::vector<std::byte> report_;
};

ReportStart IsolatedReading::start() const {
    ReportStart start;
    std::memcpy(&start, report_.data(), sizeof start);
    return start;
}

void IsolatedReading::failWithGarbage(const std::string& why) const {
    throw InputError(name_ + ": the reader went wrong and handed over no sound mesh (" + why +
                     "); the file is damaged, or hits a bug of the library that reads it");
}

void IsolatedReading::failWithEnd(const ProcessEnd& end) const {
    throw InputError(name_ + ": the reader " + end.words +
                     "; the file is damaged, or hits a bug of the library that reads it");
}

bool IsolatedReading::isComplete() const {
    if (report_.size() < sizeof(ReportStart)) return false;
    const ReportStart s = start();
    const std::uint64_t most =
        s.outcome == ReaderOutcome::meshFollows ? std::uint64_t(limits_.memoryBytes) : kLongestMessage;
    if (s.magic != ReportStart::kMagic || s.outcome > ReaderOutcome::outOfMemory || s.bytes > most ||
        report_.size() - sizeof s > s.bytes)
        failWithGarbage("its report makes no sense");
    return report_.size() - sizeof s == s.bytes;
}

/// Takes what there is in the pipe. False when the child has closed it.
bool IsolatedReading::receive(int descriptor) {
    std::array<std::byte, 1 << 16> buffer;
    while (!isComplete()) {
        const ssize_t count = ::read(descriptor, buffer.data(), buffer.size());
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) return true;
        if (count == 0) return false;
        report_.insert(report_.end(), buffer.begin(), buffer.begin() + count);
    }
    return true;
}

void IsolatedReading::checkTimes(double spentMs, const ReaderProcess& process) const {
    const std::string taken = name_ + ": reading it took more than ";
    const std::string usual = ", the limit for a file like this; --max-read-time sets another";
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

/// False when the child closed its end before its report was whole.
bool IsolatedReading::awaitReport(ReaderProcess& process) {
    report_.clear();
    double spentMs = 0;
    Timer timer;
    while (true) {
        execution_.throwIfCancelled();
        const bool open = receive(process.reports());
        if (isComplete()) return true;
        if (!open) return false;
        // Time in which this process didn't run, stopped by Ctrl-Z say, isn't the reader's.
        spentMs += std::min(timer.restart(), 5.0 * kTickMs);
        checkTimes(spentMs, process);
        const double leftMs = limits_.seconds * 1e3 - spentMs;
        pollfd reports{process.reports(), POLLIN, 0};
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
                name_ + ": reading it needs more than " + inMiB(limits_.memoryBytes) + " of memory, " +
                (given_.memoryBytes > 0
                     ? "the limit given; for a file like this it would be " + inMiB(usual_.memoryBytes)
                     : "the limit for a file like this; --max-memory sets another"));
        case ReaderOutcome::outOfMemory:
            throw std::bad_alloc();
        default:
            throw std::runtime_error(message);
    }
}

/// The mesh, or the error, of a report that is whole.
MeshFile IsolatedReading::takeMesh(ReaderProcess& process) {
    const ReportStart answer = start();
    const std::span<const std::byte> rest = std::span(report_).subspan(sizeof answer);
    const std::int64_t heldBytes = residentMemoryBytes();
    const auto unpack = [&](std::span<const std::byte> packet) {
        MeshFile file = readPacket(packet, execution_);
        file.readPeakBytes += heldBytes;
        return file;
    };
    try {
        if (answer.outcome == ReaderOutcome::meshFollows) return unpack(rest);
        if (answer.outcome == ReaderOutcome::meshInMemory)
            return unpack(SealedMemory(process.mesh()).bytes());
    } catch (const DamagedPacket& damage) {
        failWithGarbage(damage.what());
    }
    rethrow(answer.outcome, {reinterpret_cast<const char*>(rest.data()), rest.size()});
}

/// Nothing when the program doesn't read this format, or can't be used: isn't one, is of another build, lacks
/// a library.
std::optional<MeshFile> IsolatedReading::readQuickly(const std::string& executable,
                                                     const std::vector<std::string>& request) {
    std::optional<ReaderProcess> process;
    try {
        process.emplace(executable, request);
    } catch (const IoError&) {
        return std::nullopt;
    }
    if (!awaitReport(*process)) {
        const ProcessEnd end = process->describeEnd();
        if (end.bySignal) failWithEnd(end);
        return std::nullopt;
    }
    if (start().outcome == ReaderOutcome::otherFormat) return std::nullopt;
    return takeMesh(*process);
}

MeshFile IsolatedReading::run(const IsolatedReader& reader) {
    const std::vector<std::string> request =
        requestWords({::getpid(), limits_.memoryBytes, execution_.threads, path_, options_});
    if (!reader.quickExecutable.empty()) {
        if (std::optional<MeshFile> mesh = readQuickly(reader.quickExecutable, request))
            return *std::move(mesh);
    }
    std::vector<std::string> words = reader.arguments;
    words.insert(words.end(), request.begin(), request.end());
    ReaderProcess process(reader.executable, words);
    if (!awaitReport(process)) failWithEnd(process.describeEnd());
    return takeMesh(process);
}

}  // namespace

std::string quickReaderBeside(const std::string& executable) {
    namespace fs = std::filesystem;
    std::error_code error;
    const fs::path directory = fs::canonical(executable, error).parent_path();
    for (const char* place : {"", TESSERA_READER_FROM_BINDIR}) {
        const fs::path candidate = directory / place / "tessera_read_mesh";
        if (!error && fs::is_regular_file(candidate, error) && ::access(candidate.c_str(), X_OK) == 0)
            return candidate.string();
    }
    return {};
}

MeshFile readMeshIsolated(const IsolatedReader& reader, const std::string& path, const ReadOptions& options,
                          const IsolationLimits& limits, const Execution& execution) {
    execution.throwIfCancelled();
    return IsolatedReading(path, options, limits, execution).run(reader);
}

}  // namespace tessera
