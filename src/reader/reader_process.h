#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/child_process.h"

namespace tessera {

/// Descriptors that a reader's process finds open.
constexpr int kReportDescriptor = 3;  ///< a socket to its parent: the request comes, reports go
constexpr int kAnswerDescriptor = 4;  ///< an empty file in memory (memfd) for the answer

/// A file in memory as read-only bytes that nobody can change any more.
class SealedMemory {
  public:
    /// Seals the file's size and content, then maps it. Throws DamagedPacket when somebody can still write to
    /// it, it has holes, or is larger than that.
    SealedMemory(int descriptor, std::int64_t mostBytes);
    ~SealedMemory();
    SealedMemory(const SealedMemory&) = delete;
    SealedMemory& operator=(const SealedMemory&) = delete;
    std::span<const std::byte> bytes() const { return bytes_; }

  private:
    std::span<const std::byte> bytes_;
};

/// A running child with nothing but the two descriptors above. It is killed and reaped when this object ends.
class ReaderProcess {
  public:
    /// Throws IoError when the program can't be started.
    ReaderProcess(const std::string& executable, const std::vector<std::string>& arguments);

    int reports() const { return reports_.get(); }  ///< never blocks
    int answer() const { return answer_.get(); }
    double processorSeconds() const { return child_->processorSeconds(); }
    ProcessEnd describeEnd() { return child_->describeEnd(); }
    /// Ends a child that has reported all there is, and so gives its memory back.
    void end() { child_.reset(); }

  private:
    Descriptor reports_, answer_;
    std::optional<ChildProcess> child_;
};

}  // namespace tessera
