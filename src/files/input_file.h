#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

/// A regular file, looked at piece by piece. Mapped memory would end the program where somebody cuts the file
/// off meanwhile; here that is an InputError, from any function that reads.
class InputFile {
  public:
    static constexpr std::size_t npos = std::string_view::npos;

    /// Throws InputError when the file is missing, not a regular one, empty or not readable.
    explicit InputFile(const std::string& path);
    ~InputFile();
    InputFile(const InputFile&) = delete;
    InputFile& operator=(const InputFile&) = delete;

    const std::string& path() const { return path_; }
    std::size_t size() const { return size_; }

    /// Bytes from `at`: `least` or more, fewer only at the file's end. Valid until the next call of any
    /// function here.
    std::string_view bytesFrom(std::size_t at, std::size_t least = 1);
    /// `count` bytes from `at`, fewer only at the file's end.
    std::string copy(std::size_t at, std::size_t count);

    /// Fills `bytes` from `at`. Throws InputError where the file ends before. May be called from several
    /// threads at once.
    void read(std::size_t at, std::span<char> bytes) const;

    /// As those of std::string_view.
    std::size_t find(std::string_view word, std::size_t from);
    std::size_t rfind(std::string_view word);
    std::size_t findFirstOf(std::string_view characters, std::size_t from);
    std::size_t findFirstNotOf(std::string_view characters, std::size_t from);

  private:
    template <class Search>
    std::size_t search(std::size_t from, std::size_t length, const Search& inPiece);
    void fill(std::size_t at, std::size_t count);

    std::string path_;
    int descriptor_ = -1;
    std::size_t size_ = 0;
    std::vector<char> piece_;
    std::size_t pieceAt_ = 0;
};

/// All of a file. Throws InputError as InputFile does, and for a file that is larger.
std::string readWholeFile(const std::string& path, std::size_t mostBytes = std::size_t(-1));

}  // namespace tessera
