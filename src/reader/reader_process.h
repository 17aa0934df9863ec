#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace tessera {

/// Descriptors that a reader's process finds open.
constexpr int kReportDescriptor = 3;  ///< a socket to its parent: the request comes, reports go
constexpr int kAnswerDescriptor = 4;  ///< an empty file in memory (memfd) for the answer

/// A file descriptor that closes itself.
class Descriptor {
  public:
    explicit Descriptor(int number = -1) : number_(number) {}
    ~Descriptor() { close(); }
    Descriptor(Descriptor&& other) noexcept : number_(other.number_) { other.number_ = -1; }
    Descriptor& operator=(Descriptor&& other) noexcept;
    int get() const { return number_; }
    void close();

  private:
    int number_;
};

/// A file in memory as read-only bytes that nobody can change any more.
class SealedMemory {
  public:
    /// Seals the file's size and content, then maps it. Throws DamagedPacket when somebody can still write to
    /// it, or it is larger than that.
    SealedMemory(int descriptor, std::int64_t mostBytes);
    ~SealedMemory();
    SealedMemory(const SealedMemory&) = delete;
    SealedMemory& operator=(const SealedMemory&) = delete;
    std::span<const std::byte> bytes() const { return bytes_; }

  private:
    std::span<const std::byte> bytes_;
};

/// How a child ended.
struct ProcessEnd {
    std::string words;  ///< "crashed (signal 11, Segmentation fault)", "ended without a result (exit code 7)"
    bool bySignal = false;
    bool byProcessorLimit = false;  ///< the system's (ulimit -t)
};

/// A running child with nothing but the two descriptors above; its standard streams lead nowhere, and it
/// doesn't see the terminal's signals. It is killed and reaped when this object ends.
class ReaderProcess {
  public:
    /// Throws IoError when the program can't be started.
    ReaderProcess(const std::string& executable, const std::vector<std::string>& arguments);
    ~ReaderProcess();
    ReaderProcess(const ReaderProcess&) = delete;
    ReaderProcess& operator=(const ReaderProcess&) = delete;

    int reports() const { return reports_.get(); }  ///< never blocks
    int answer() const { return answer_.get(); }
    /// Processor time that the child has taken so far, of all its threads; 0 when it has ended.
    double processorSeconds() const;
    /// Says how a child ended that closed its reports: "crashed (signal 11, Segmentation fault)", "ended
    /// without a result (exit code 7)". Kills it if it hasn't ended after all.
    ProcessEnd describeEnd();

  private:
    void kill();
    void open();

    Descriptor childReports_, childAnswer_;  // until the child has them
    Descriptor reports_, answer_;
    pid_t child_ = -1;
};

}  // namespace tessera
