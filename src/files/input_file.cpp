#include "files/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kPieceBytes = 256 << 10;  // stays in a processor's cache

/// Reads exactly `count` bytes.
void readAt(int descriptor, const std::string& path, std::size_t at, char* bytes, std::size_t count) {
    while (count > 0) {
        const ssize_t got = ::pread(descriptor, bytes, count, off_t(at));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) throw InputError(path + ": can't be read: " + std::strerror(errno));
        if (got == 0)
            throw InputError(path + ": was cut off while it was read: byte " + std::to_string(at) +
                             " isn't there any more");
        at += std::size_t(got);
        bytes += got;
        count -= std::size_t(got);
    }
}

void checkStatus(const std::string& path, const struct stat& status) {
    if (S_ISDIR(status.st_mode)) throw InputError(path + ": is a directory, expected a file");
    if (!S_ISREG(status.st_mode)) throw InputError(path + ": isn't a regular file");
    if (status.st_size == 0) throw InputError(path + ": the file is empty");
}

}  // namespace

InputFile::InputFile(const std::string& path) : path_(path) {
    struct stat status {};
    if (::stat(path.c_str(), &status) != 0) {
        if (errno == ENOENT || errno == ENOTDIR) throw InputError(path + ": there is no such file");
        throw InputError(path + ": can't be read: " + std::strerror(errno));
    }
    checkStatus(path, status);  // before a device is opened, which may do something
    // Should it have become a pipe by now, nobody waits for its writer.
    descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (descriptor_ < 0) {
        const std::string why = path + ": can't be read: " + std::strerror(errno);
        if (errno == EMFILE || errno == ENFILE) throw IoError(why);  // not the file's fault
        throw InputError(why);
    }
    try {
        if (::fstat(descriptor_, &status) != 0)
            throw InputError(path + ": can't be read: " + std::strerror(errno));
        checkStatus(path, status);
        size_ = std::size_t(status.st_size);
        piece_.reserve(std::min(size_, kPieceBytes));
    } catch (...) {
        ::close(descriptor_);
        throw;
    }
}

InputFile::~InputFile() {
    ::close(descriptor_);
}

void InputFile::read(std::size_t at, std::span<char> bytes) const {
    readAt(descriptor_, path_, at, bytes.data(), bytes.size());
}

void InputFile::fill(std::size_t at, std::size_t count) {
    piece_.resize(count);
    pieceAt_ = at;
    try {
        readAt(descriptor_, path_, at, piece_.data(), count);
    } catch (...) {
        piece_.clear();
        throw;
    }
}

std::string_view InputFile::bytesFrom(std::size_t at, std::size_t least) {
    if (at >= size_) return {};
    least = std::min(least, size_ - at);
    if (at < pieceAt_ || at + least > pieceAt_ + piece_.size())
        fill(at, std::min(size_ - at, std::max(least, kPieceBytes)));
    return std::string_view(piece_.data(), piece_.size()).substr(at - pieceAt_);
}

std::string InputFile::copy(std::size_t at, std::size_t count) {
    if (count <= kPieceBytes) return std::string(bytesFrom(at, count).substr(0, count));
    std::string bytes(std::min(count, size_ - std::min(at, size_)), '\0');
    readAt(descriptor_, path_, at, bytes.data(), bytes.size());
    return bytes;
}

/// @param inPiece finds the place of something `length` bytes long in a string_view.
template <class Search>
std::size_t InputFile::search(std::size_t from, std::size_t length, const Search& inPiece) {
    while (from < size_ && size_ - from >= length) {
        const std::string_view piece = bytesFrom(from, length);
        if (const std::size_t at = inPiece(piece); at != npos) return from + at;
        from += piece.size() - length + 1;
    }
    return npos;
}

std::size_t InputFile::find(std::string_view word, std::size_t from) {
    return search(from, word.size(), [&](std::string_view piece) { return piece.find(word); });
}

std::size_t InputFile::findFirstOf(std::string_view characters, std::size_t from) {
    return search(from, 1, [&](std::string_view piece) { return piece.find_first_of(characters); });
}

std::size_t InputFile::findFirstNotOf(std::string_view characters, std::size_t from) {
    return search(from, 1, [&](std::string_view piece) { return piece.find_first_not_of(characters); });
}

std::size_t InputFile::rfind(std::string_view word) {
    for (std::size_t end = size_; end >= word.size();) {
        const std::size_t begin = end - std::min(end, kPieceBytes);
        const std::size_t at = bytesFrom(begin, end - begin).substr(0, end - begin).rfind(word);
        if (at != npos) return begin + at;
        if (begin == 0) break;
        end = begin + word.size() - 1;
    }
    return npos;
}

std::string readWholeFile(const std::string& path, std::size_t mostBytes) {
    InputFile file(path);
    if (file.size() > mostBytes)
        throw InputError(path + ": larger than " + std::to_string(mostBytes >> 20) + " MiB");
    return file.copy(0, file.size());
}

}  // namespace tessera
