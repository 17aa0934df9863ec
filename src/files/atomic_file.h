#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <span>
#include <streambuf>
#include <string>
#include <vector>

#include "tessera/error.h"
#include "tessera/execution.h"

namespace tessera {

/// The name that stands for standard output where a file is written.
inline constexpr const char* kStandardOutput = "-";

/// Whoever read standard output has gone, having seen enough.
class OutputClosed : public IoError {
  public:
    using IoError::IoError;
};

/// A file that appears at its name only when it is whole. Bytes go to a temporary file in the same directory,
/// which `commit` syncs and renames; without a commit the destructor removes it and whatever stood at the
/// name stays as it was. What lies far behind in a large file goes past the system's cache of files, where it
/// would take the memory of what is read more than once, and the time to get it: `commit` waits for the disk
/// in any case.
///
/// For kStandardOutput the bytes are gathered in a temporary file without a name, as most formats need to go
/// back in it, and `commit` copies them out.
class AtomicFile {
  public:
    /// Throws IoError when the directory is missing or not writable, or `path` names something that isn't a
    /// regular file; InputError when standard output is a terminal.
    explicit AtomicFile(const std::string& path);
    ~AtomicFile();
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    /// Writes all bytes at an offset from the file's start. Throws IoError with the system's reason (disk
    /// full, ...).
    void writeAt(std::int64_t offset, const void* bytes, std::size_t count);
    /// Reads up to `count` bytes back; returns how many there were. Throws IoError.
    std::size_t readAt(std::int64_t offset, void* bytes, std::size_t count) const;
    std::int64_t size() const { return size_; }
    /// Syncs, closes and renames to the final name, or copies to standard output. Throws IoError,
    /// OutputClosed, and while copying Cancelled.
    void commit(const Execution& execution = {});

    const std::string& path() const { return path_; }
    const std::string& temporaryPath() const { return temporaryPath_; }

  private:
    void openNameless();
    bool writePastCache(std::int64_t offset, const char* bytes, std::size_t count);
    void copyOut(const Execution& execution) const;

    static constexpr int kUnopened = -2;
    std::string path_;  // for people to read where it is standard output
    std::string temporaryPath_;
    bool isStandardOutput_ = false;
    int descriptor_ = -1;
    int pastCache_ = kUnopened;
    int slot_ = -1;
    std::int64_t size_ = 0;
};

/// Output side of a std::ostream over an AtomicFile. Bytes are written by a thread of their own while the
/// next ones are gathered, where there is a thread to be had (`policyOf`). Throws IoError from a write after
/// the one that failed (set the stream's exceptions to badbit so that it passes through) and Cancelled when
/// the caller asks to stop.
class AtomicFileBuffer : public std::streambuf {
  public:
    using Watch = std::function<void(std::span<const char>)>;
    /// @param watch gets the bytes piece by piece, in the order in which they are written.
    AtomicFileBuffer(AtomicFile& file, const Execution& execution, Watch watch = {});
    ~AtomicFileBuffer() override;
    /// Waits until all is written.
    void flushAll();
    /// How std::async runs what writes: by a thread of its own, unless there is none to be had. What it runs
    /// is given as an lvalue: where no thread starts, the library takes it a second time.
    static std::launch policyOf(const Execution& execution);

  protected:
    int_type overflow(int_type c) override;
    std::streamsize xsputn(const char* s, std::streamsize n) override;
    int sync() override;
    pos_type seekoff(off_type offset, std::ios_base::seekdir direction, std::ios_base::openmode) override;
    pos_type seekpos(pos_type position, std::ios_base::openmode mode) override;

  private:
    void handOver();

    AtomicFile* file_;
    const Execution* execution_;
    Watch watch_;
    struct Piece;
    std::array<std::unique_ptr<Piece>, 2> pieces_;  // one is filled while the other is written
    std::future<void> writing_;
    std::int64_t bufferStart_ = 0;  // offset in the file of the buffer's first byte
};

/// Throws at once, as AtomicFile does, when a file could not be written at `path`: missing directory, a
/// directory or device of this name, no permission. Call it before long work.
void checkWritable(const std::string& path);

/// Writes a whole small file atomically. Throws IoError.
void writeFileAtomically(const std::string& path, const std::string& bytes);

/// Unlinks every temporary file that is open now. Async-signal-safe: for handlers of signals that end the
/// process.
void removeTemporaryFiles() noexcept;

}  // namespace tessera
