#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "base/error.h"
#include "io/mapped_file.h"
#include "io/xml_check.h"
#include "io/xml_tags.h"

namespace tessera {

namespace {

constexpr std::int64_t kMostNodes = 2147483647;

/// A line's keyword, and how many bytes its numbers say that it needs at least.
struct Declaration {
    std::string_view keyword;
    int numbers;         ///< that follow the keyword
    double asciiBytes;   ///< for each of what they count: a digit and a space
    double binaryBytes;  ///< the smallest type
};
// CELLS n size: the second is the number of integers. DIMENSIONS and POINT_DATA count what other lines pay
// for.
constexpr Declaration kDeclarations[] = {
    {"\nPOINTS ", 1, 6, 3},        {"\nCELLS ", 2, 2, 4},         {"\nCELL_TYPES ", 1, 2, 4},
    {"\nPOINT_DATA ", 1, 0, 0},    {"\nCELL_DATA ", 1, 0, 0},     {"\nDIMENSIONS ", 3, 0, 0},
    {"\nX_COORDINATES ", 1, 2, 1}, {"\nY_COORDINATES ", 1, 2, 1}, {"\nZ_COORDINATES ", 1, 2, 1}};

class LegacyCheck {
  public:
    LegacyCheck(const std::string& path, std::string_view text) : path_(path), text_(text) {}
    DeclaredSize run();

  private:
    void checkHead();
    void checkDeclaration(const Declaration& declaration, std::size_t at);
    [[noreturn]] void refuse(std::size_t at, const std::string& most) const;

    const std::string& path_;
    std::string_view text_;
    bool isAscii_ = true;
    DeclaredSize size_;
};

void LegacyCheck::checkHead() {
    if (!text_.starts_with("# vtk DataFile Version"))
        throw InputError(path_ + ": isn't a VTK file: it begins with " + quoted(text_) +
                         ", expected '# vtk DataFile Version'");
    std::size_t at = 0;
    for (int line = 0; line < 4 && at != std::string_view::npos; ++line) {
        at = text_.find('\n', at == 0 ? 0 : at + 1);
        if (line == 1 && at != std::string_view::npos) isAscii_ = !text_.substr(at + 1).starts_with("BINARY");
    }
    if (at == std::string_view::npos && text_.find("DATASET") == std::string_view::npos)
        throw InputError(path_ + ": cut off at byte " + std::to_string(text_.size()) +
                         ", inside the four lines of its head");
}

void LegacyCheck::refuse(std::size_t at, const std::string& most) const {
    throw InputError(path_ + ": damaged: byte " + std::to_string(at + 1) + " declares " +
                     quoted(text_.substr(at + 1, text_.find('\n', at + 1) - at - 1)) + ", more than " + most);
}

void LegacyCheck::checkDeclaration(const Declaration& declaration, std::size_t at) {
    const char* next = text_.data() + at + declaration.keyword.size();
    const char* end = text_.data() + text_.size();
    double product = 1, last = 0;
    for (int i = 0; i < declaration.numbers; ++i) {
        while (next < end && *next == ' ') ++next;
        std::int64_t count = 0;
        const auto result = std::from_chars(next, end, count);
        // In binary data these letters may come up by chance: then no number follows.
        if (result.ec == std::errc::invalid_argument) return;
        const bool isTooLarge = result.ec != std::errc() || count < 0;
        const bool isGrid = declaration.numbers == 3;
        if (isTooLarge || count > (isGrid ? kMostNodes : std::int64_t(text_.size())))
            refuse(at, isGrid ? "are possible" : std::to_string(text_.size()) + " bytes can hold");
        next = result.ptr;
        last = double(count);
        product *= last;
    }
    if (declaration.numbers == 3) {
        if (product > double(kMostNodes)) refuse(at, std::to_string(kMostNodes) + " points");
        // Only values that the file holds make a grid that is worth its memory.
        size_.gridPoints = std::int64_t(std::min(product, double(text_.size())));
        return;
    }
    const auto rest = double(end - next);
    if (last * (isAscii_ ? declaration.asciiBytes : declaration.binaryBytes) > rest + 1)
        refuse(at, std::to_string(std::int64_t(rest)) + " bytes can hold");
    if (declaration.keyword == "\nCELL_TYPES ") size_.cellsOfAll = std::int64_t(last);
}

DeclaredSize LegacyCheck::run() {
    checkHead();
    size_.fileBytes = std::int64_t(text_.size());
    for (const Declaration& declaration : kDeclarations)
        for (std::size_t at = text_.find(declaration.keyword); at != std::string_view::npos;
             at = text_.find(declaration.keyword, at + 1))
            checkDeclaration(declaration, at);
    return size_;
}

}  // namespace

DeclaredSize checkLegacyFile(const std::string& path) {
    const MappedFile file(path);
    return LegacyCheck(path, file.bytes()).run();
}

}  // namespace tessera
