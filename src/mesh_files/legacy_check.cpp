#include "mesh_files/legacy_check.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>

#include "files/input_file.h"
#include "files/xml_tags.h"
#include "mesh_files/xml_check.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::string_view kWhiteSpace = " \t\n\v\f\r";
constexpr std::int64_t kMostNodes = 2147483647;
constexpr std::size_t kLongestDeclaration = 512;

/// A keyword, and how many bytes its numbers say that it needs at least.
struct Declaration {
    std::string_view keyword;
    std::size_t numbers;  ///< that follow the keyword
    double asciiBytes;    ///< for each of what they count: a digit and a space
    double binaryBytes;   ///< the smallest type
};
// cells n size: the second is the number of integers. dimensions and point_data count what other lines pay
// for.
constexpr Declaration kDeclarations[] = {
    {"points", 1, 6, 3},        {"cells", 2, 2, 4},         {"cell_types", 1, 2, 4},
    {"point_data", 1, 0, 0},    {"cell_data", 1, 0, 0},     {"dimensions", 3, 0, 0},
    {"x_coordinates", 1, 2, 1}, {"y_coordinates", 1, 2, 1}, {"z_coordinates", 1, 2, 1}};

char lower(char c) {
    return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
}

bool startsWithWord(std::string_view text, std::string_view lowerWord) {
    return text.size() >= lowerWord.size() && std::equal(lowerWord.begin(), lowerWord.end(), text.begin(),
                                                         [](char a, char b) { return a == lower(b); });
}

/// What a byte may be. The next bit for an initial, so that one test finds it behind a blank.
constexpr unsigned char kBlank = 1, kInitial = kBlank << 1;
constexpr std::array<unsigned char, 256> kKinds = [] {
    std::array<unsigned char, 256> kinds{};
    for (const char blank : kWhiteSpace) kinds[static_cast<unsigned char>(blank)] = kBlank;
    for (const Declaration& declaration : kDeclarations) {
        const auto initial = static_cast<unsigned char>(declaration.keyword.front());
        kinds[initial] = kinds[initial - 'a' + 'A'] = kInitial;
    }
    return kinds;
}();

/// Takes words as VTK's own reader does: between blanks of any kind, in small or capital letters, and the
/// second line, a title, is nobody's business.
class LegacyCheck {
  public:
    explicit LegacyCheck(const std::string& path) : path_(path), file_(path) {}
    DeclaredSize run();

  private:
    std::size_t checkHead();
    void checkPiece(std::string_view piece, std::size_t count, std::size_t at);
    void checkWord(std::string_view text, std::size_t at);
    void checkDeclaration(const Declaration& declaration, std::string_view text, std::size_t at);
    [[noreturn]] void refuse(std::string_view text, std::size_t at, const std::string& most) const;

    const std::string& path_;
    InputFile file_;
    bool isAscii_ = true;
    unsigned kindBefore_ = kBlank;  ///< of the byte before the piece that is looked at
    DeclaredSize size_;
};

/// Returns where the words behind ASCII or BINARY begin.
std::size_t LegacyCheck::checkHead() {
    const std::string_view first = file_.bytesFrom(0, 32);
    if (!first.starts_with("# vtk DataFile Version"))
        throw InputError(path_ + ": isn't a VTK file: it doesn't begin with '# vtk DataFile Version'");
    const std::size_t title = file_.find("\n", 0);
    const std::size_t titleEnd = title == InputFile::npos ? title : file_.find("\n", title + 1);
    const std::size_t kind =
        titleEnd == InputFile::npos ? titleEnd : file_.findFirstNotOf(kWhiteSpace, titleEnd);
    const std::size_t kindEnd = kind == InputFile::npos ? kind : file_.findFirstOf(kWhiteSpace, kind);
    const std::size_t next =
        kindEnd == InputFile::npos ? kindEnd : file_.findFirstNotOf(kWhiteSpace, kindEnd);
    if (next == InputFile::npos || file_.findFirstOf(kWhiteSpace, next) == InputFile::npos)
        throw InputError(path_ + ": cut off at byte " + std::to_string(file_.size()) +
                         ", inside the four lines of its head");
    isAscii_ = !startsWithWord(file_.bytesFrom(kind, 6), "binary");
    return kindEnd;
}

void LegacyCheck::refuse(std::string_view text, std::size_t at, const std::string& most) const {
    throw InputError(path_ + ": damaged: byte " + std::to_string(at) + " declares " +
                     quoted(text.substr(0, text.find_first_of("\r\n"))) + ", more than " + most);
}

/// @param text from the keyword on; @param at its byte.
void LegacyCheck::checkDeclaration(const Declaration& declaration, std::string_view text, std::size_t at) {
    std::size_t next = std::min(text.find_first_of(kWhiteSpace), text.size());
    double product = 1, last = 0;
    for (std::size_t i = 0; i < declaration.numbers; ++i) {
        next = std::min(text.find_first_not_of(kWhiteSpace, next), text.size());
        if (text.substr(next).starts_with('+')) ++next;
        std::int64_t count = 0;
        const auto result = std::from_chars(text.data() + next, text.data() + text.size(), count);
        // In binary data and among names these letters may come up by chance: then no number follows.
        if (result.ec == std::errc::invalid_argument) return;
        const bool isTooLarge = result.ec != std::errc() || count < 0;
        const bool isGrid = declaration.numbers == 3;
        if (isTooLarge || count > (isGrid ? kMostNodes : std::int64_t(file_.size())))
            refuse(text, at, isGrid ? "are possible" : std::to_string(file_.size()) + " bytes can hold");
        next = std::size_t(result.ptr - text.data());
        last = double(count);
        product *= last;
    }
    if (declaration.numbers == 3) {
        if (product > double(kMostNodes)) refuse(text, at, std::to_string(kMostNodes) + " points");
        // Only values that the file holds make a grid that is worth its memory.
        size_.gridPoints = std::int64_t(std::min(product, double(file_.size())));
        return;
    }
    const auto rest = double(file_.size() - at - next);
    if (last * (isAscii_ ? declaration.asciiBytes : declaration.binaryBytes) > rest + 1)
        refuse(text, at, std::to_string(std::int64_t(rest)) + " bytes can hold");
    if (declaration.keyword == "cell_types")
        size_.cellsOfAll = std::max(size_.cellsOfAll, std::int64_t(last));
}

/// @param text from a word's first letter on; @param at its byte.
void LegacyCheck::checkWord(std::string_view text, std::size_t at) {
    text = text.substr(0, kLongestDeclaration);
    for (const Declaration& declaration : kDeclarations)
        if (startsWithWord(text, declaration.keyword)) checkDeclaration(declaration, text, at);
}

/// Looks at the words that begin in the first `count` bytes of a piece at byte `at`.
void LegacyCheck::checkPiece(std::string_view piece, std::size_t count, std::size_t at) {
    unsigned before = kindBefore_;
    for (std::size_t i = 0; i < count; ++i) {
        const unsigned kind = kKinds[static_cast<unsigned char>(piece[i])];
        if ((before << 1 & kind) != 0) checkWord(piece.substr(i), at + i);
        before = kind;
    }
    kindBefore_ = before;
}

DeclaredSize LegacyCheck::run() {
    size_.fileBytes = std::int64_t(file_.size());
    for (std::size_t at = checkHead(); at < file_.size();) {
        const std::string_view piece = file_.bytesFrom(at, kLongestDeclaration);
        const bool isLast = at + piece.size() == file_.size();
        const std::size_t count = isLast ? piece.size() : piece.size() - kLongestDeclaration + 1;
        checkPiece(piece, count, at);
        at += count;
    }
    return size_;
}

}  // namespace

DeclaredSize checkLegacyFile(const std::string& path) {
    return LegacyCheck(path).run();
}

}  // namespace tessera
