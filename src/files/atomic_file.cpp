#include "files/atomic_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>

#include "base/check.h"
#include "tessera/error.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBufferBytes = std::size_t(2) << 20;
constexpr std::size_t kDiskBlockBytes = 4096;
constexpr std::int64_t kCachedBytes = std::int64_t(64) << 20;  // at a file's start; all of most files

// Names that a signal handler may have to unlink: fixed storage, because a handler must not allocate or lock.
struct Slot {
    std::atomic<int> state{0};  // 0 free, 1 being filled, 2 name is valid
    std::array<char, PATH_MAX> name{};
};
std::array<Slot, 64> slots;

int registerTemporary(const std::string& name) {
    if (name.size() >= PATH_MAX) return -1;
    for (std::size_t i = 0; i < slots.size(); ++i) {
        int expected = 0;
        if (!slots[i].state.compare_exchange_strong(expected, 1)) continue;
        std::memcpy(slots[i].name.data(), name.c_str(), name.size() + 1);
        slots[i].state.store(2);
        return int(i);
    }
    return -1;
}

void unregisterTemporary(int slot) {
    if (slot >= 0) slots[std::size_t(slot)].state.store(0);
}

std::string reason(int error) {
    return std::generic_category().message(error);
}

[[noreturn]] void fail(const std::string& path, const std::string& why) {
    throw IoError("can't write " + path + ": " + why);
}

// A symbolic link is followed, so that the file it names is made or replaced and not the link.
fs::path resolveTarget(const std::string& path) {
    constexpr int kMostLinks = 40;  // as the kernel has it
    std::error_code error;
    fs::path name(path);
    for (int links = 0; fs::is_symlink(name, error); ++links) {
        if (links == kMostLinks) fail(path, reason(ELOOP));
        name = name.parent_path() / fs::read_symlink(name, error);
        if (error) fail(path, reason(error.value()));
    }
    return name;
}

void checkTarget(const std::string& path, const fs::path& target) {
    if (path.empty()) fail("the output", "its name is empty");
    std::error_code error;
    const fs::file_status status = fs::status(target, error);
    if (fs::is_directory(status)) fail(path, "it is a directory");
    // Renaming over a device or pipe would replace it in the file system.
    if (fs::exists(status) && !fs::is_regular_file(status)) fail(path, "it is not a regular file");
    if (!target.has_filename()) fail(path, "it names no file");
    const fs::path directory = target.has_parent_path() ? target.parent_path() : fs::path(".");
    const fs::file_status parent = fs::status(directory, error);
    if (!fs::exists(parent)) fail(path, "there is no directory " + directory.string());
    if (!fs::is_directory(parent)) fail(path, directory.string() + " is not a directory");
}

std::string temporaryName(const fs::path& target, int attempt) {
    // The longest name a file system takes is mostly 255 bytes, and the prefix and suffix need some of them.
    std::string name = ".";
    name.append(target.filename().string(), 0, 200);
    name.append(".").append(std::to_string(::getpid()));
    if (attempt > 0) name.append("-").append(std::to_string(attempt));
    return (target.parent_path() / name.append(".tmp")).string();
}

}  // namespace

void AtomicFile::openNameless() {
    path_ = "standard output";
    isStandardOutput_ = true;
    if (::isatty(STDOUT_FILENO))
        throw InputError("standard output is a terminal: send it to a file or to another program");
    const int flags = ::fcntl(STDOUT_FILENO, F_GETFL);
    if (flags < 0 || (flags & O_ACCMODE) == O_RDONLY) fail(path_, reason(EBADF));
    std::error_code error;
    fs::path folder = fs::temp_directory_path(error);
    if (error) folder = "/tmp";
    temporaryPath_ = "a temporary file in " + folder.string();
    descriptor_ = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (descriptor_ >= 0) return;
    // Not every file system has files without a name.
    std::string name = (folder / "tessera-XXXXXX").string();
    descriptor_ = ::mkostemp(name.data(), O_CLOEXEC);
    if (descriptor_ >= 0) {
        ::unlink(name.c_str());
        return;
    }
    // A bare container may have no folder that can be written.
    descriptor_ = ::memfd_create("tessera", MFD_CLOEXEC);
    if (descriptor_ < 0) fail(temporaryPath_, reason(errno));
    temporaryPath_ = "a temporary file in memory";
}

AtomicFile::AtomicFile(const std::string& path) : path_(path) {
    if (path == kStandardOutput) {
        openNameless();
        return;
    }
    const fs::path target = resolveTarget(path);
    checkTarget(path, target);
    path_ = target.string();
    struct stat existing {};
    const bool exists = ::stat(path_.c_str(), &existing) == 0;
    if (!exists && errno == ENAMETOOLONG) fail(path, reason(ENAMETOOLONG));
    for (int attempt = 0; descriptor_ < 0; ++attempt) {
        temporaryPath_ = temporaryName(target, attempt);
        descriptor_ = ::open(temporaryPath_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (descriptor_ < 0 && (errno != EEXIST || attempt > 1000)) fail(path, reason(errno));
    }
    slot_ = registerTemporary(temporaryPath_);
    if (exists && ::fchmod(descriptor_, existing.st_mode & 07777) != 0) errno = 0;  // a nicety only
}

AtomicFile::~AtomicFile() {
    if (pastCache_ >= 0) ::close(pastCache_);
    if (descriptor_ >= 0) {
        ::close(descriptor_);
        if (!isStandardOutput_) ::unlink(temporaryPath_.c_str());
    }
    unregisterTemporary(slot_);
}

// False where that can't be done, by this file system say; some bytes may be written then.
bool AtomicFile::writePastCache(std::int64_t offset, const char* bytes, std::size_t count) {
    const auto isWhole = [](std::uint64_t n) { return n % kDiskBlockBytes == 0; };
    if (isStandardOutput_ || offset < kCachedBytes || count < kBufferBytes ||
        !isWhole(std::uint64_t(offset)) || !isWhole(count) ||
        !isWhole(reinterpret_cast<std::uintptr_t>(bytes)))
        return false;
    if (pastCache_ == kUnopened)
        pastCache_ = ::open(temporaryPath_.c_str(), O_WRONLY | O_DIRECT | O_NOFOLLOW | O_CLOEXEC);
    return pastCache_ >= 0 && ::pwrite(pastCache_, bytes, count, off_t(offset)) == ssize_t(count);
}

void AtomicFile::writeAt(std::int64_t offset, const void* bytes, std::size_t count) {
    const char* next = static_cast<const char*>(bytes);
    if (writePastCache(offset, next, count)) {
        size_ = std::max(size_, offset + std::int64_t(count));
        return;
    }
    while (count > 0) {
        const ssize_t written = ::pwrite(descriptor_, next, count, off_t(offset));
        if (written < 0) {
            if (errno == EINTR) continue;
            fail(isStandardOutput_ ? temporaryPath_ : path_, reason(errno));
        }
        // The disk starts now, which shortens the wait for it in the end.
        if (std::size_t(written) >= kBufferBytes / 2)
            ::sync_file_range(descriptor_, off_t(offset), off_t(written), SYNC_FILE_RANGE_WRITE);
        next += written;
        offset += written;
        count -= std::size_t(written);
        size_ = std::max(size_, offset);
    }
}

std::size_t AtomicFile::readAt(std::int64_t offset, void* bytes, std::size_t count) const {
    while (true) {
        const ssize_t got = ::pread(descriptor_, bytes, count, off_t(offset));
        if (got >= 0) return std::size_t(got);
        if (errno != EINTR) throw IoError("can't read " + temporaryPath_ + " back: " + reason(errno));
    }
}

void AtomicFile::copyOut(const Execution& execution) const {
    std::vector<char> bytes(kBufferBytes);
    for (std::int64_t offset = 0; offset < size_;) {
        const std::size_t count = readAt(offset, bytes.data(), bytes.size());
        if (count == 0) throw IoError("can't read " + temporaryPath_ + " back: it ends early");
        for (std::size_t done = 0; done < count;) {
            execution.throwIfCancelled();
            const ssize_t written = ::write(STDOUT_FILENO, bytes.data() + done, count - done);
            if (written >= 0) {
                done += std::size_t(written);
            } else if (errno == EAGAIN) {  // whoever shares the pipe may have set it so
                pollfd ready{STDOUT_FILENO, POLLOUT, 0};
                ::poll(&ready, 1, 1000);
            } else if (errno == EPIPE) {
                throw OutputClosed("can't write " + path_ + ": " + reason(EPIPE));
            } else if (errno != EINTR) {
                fail(path_, reason(errno));
            }
        }
        offset += std::int64_t(count);
    }
}

void AtomicFile::commit(const Execution& execution) {
    TESSERA_CHECK(descriptor_ >= 0, "a file is committed once");
    if (isStandardOutput_) {
        copyOut(execution);
        ::close(descriptor_);
        descriptor_ = -1;
        return;
    }
    // Some file systems (network, quota) tell of a full disk only here. Others can't sync at all, which is no
    // failure.
    if (::fsync(descriptor_) != 0 && errno != EINVAL && errno != ENOTSUP && errno != EROFS)
        fail(path_, reason(errno));
    struct stat status {};
    if (::fstat(descriptor_, &status) != 0) fail(path_, reason(errno));
    if (std::int64_t(status.st_size) != size_) fail(path_, "the file is shorter than what was written");
    const int descriptor = descriptor_;
    descriptor_ = -1;
    const auto removeAndFail = [&] {
        const int error = errno;
        ::unlink(temporaryPath_.c_str());
        fail(path_, reason(error));
    };
    if (::close(descriptor) != 0) removeAndFail();
    if (::rename(temporaryPath_.c_str(), path_.c_str()) != 0) removeAndFail();
    unregisterTemporary(slot_);
    slot_ = -1;
}

struct alignas(kDiskBlockBytes) AtomicFileBuffer::Piece {
    std::array<char, kBufferBytes> bytes;
};

AtomicFileBuffer::~AtomicFileBuffer() = default;

AtomicFileBuffer::AtomicFileBuffer(AtomicFile& file, const Execution& execution, Watch watch)
    : file_(&file), execution_(&execution), watch_(std::move(watch)) {
    for (std::unique_ptr<Piece>& piece : pieces_) piece = std::make_unique_for_overwrite<Piece>();
    setp(pieces_[0]->bytes.data(), pieces_[0]->bytes.data() + kBufferBytes);
}

std::launch AtomicFileBuffer::policyOf(const Execution& execution) {
    if (execution.threadCount() == 1) return std::launch::deferred;
    return std::launch::async | std::launch::deferred;
}

void AtomicFileBuffer::handOver() {
    execution_->throwIfCancelled();
    if (writing_.valid()) writing_.get();
    const std::span<const char> piece(pbase(), pptr());
    if (piece.empty()) return;
    const auto write = [this, piece, offset = bufferStart_] {
        if (watch_) watch_(piece);
        file_->writeAt(offset, piece.data(), piece.size());
    };
    writing_ = std::async(policyOf(*execution_), write);
    bufferStart_ += std::int64_t(piece.size());
    std::swap(pieces_[0], pieces_[1]);
    setp(pieces_[0]->bytes.data(), pieces_[0]->bytes.data() + kBufferBytes);
}

void AtomicFileBuffer::flushAll() {
    handOver();
    if (writing_.valid()) writing_.get();
}

AtomicFileBuffer::int_type AtomicFileBuffer::overflow(int_type c) {
    handOver();
    if (!traits_type::eq_int_type(c, traits_type::eof())) {
        *pptr() = traits_type::to_char_type(c);
        pbump(1);
    }
    return traits_type::not_eof(c);
}

std::streamsize AtomicFileBuffer::xsputn(const char* s, std::streamsize n) {
    for (std::streamsize left = n; left > 0;) {
        if (pptr() == epptr()) handOver();
        const std::streamsize count = std::min(left, std::streamsize(epptr() - pptr()));
        std::memcpy(pptr(), s, std::size_t(count));
        pbump(int(count));
        s += count;
        left -= count;
    }
    return n;
}

int AtomicFileBuffer::sync() {
    flushAll();
    return 0;
}

AtomicFileBuffer::pos_type AtomicFileBuffer::seekoff(off_type offset, std::ios_base::seekdir direction,
                                                     std::ios_base::openmode) {
    const std::int64_t here = bufferStart_ + (pptr() - pbase());
    if (direction == std::ios_base::cur && offset == 0) return pos_type(here);
    flushAll();
    if (direction == std::ios_base::cur) offset += here;
    if (direction == std::ios_base::end) offset += file_->size();
    if (offset < 0) return pos_type(off_type(-1));
    bufferStart_ = offset;
    return pos_type(offset);
}

AtomicFileBuffer::pos_type AtomicFileBuffer::seekpos(pos_type position, std::ios_base::openmode mode) {
    return seekoff(off_type(position), std::ios_base::beg, mode);
}

void checkWritable(const std::string& path) {
    AtomicFile probe(path);
}

void writeFileAtomically(const std::string& path, const std::string& bytes) {
    AtomicFile file(path);
    file.writeAt(0, bytes.data(), bytes.size());
    file.commit();
}

void removeTemporaryFiles() noexcept {
    const int saved = errno;
    for (Slot& slot : slots) {
        if (slot.state.load() == 2) ::unlink(slot.name.data());
    }
    errno = saved;
}

}  // namespace tessera
