#include "io/ensight_check.h"

#include <glob.h>

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "io/input_file.h"

namespace tessera {

namespace {

constexpr std::string_view kSpaces = " \t\r\v\f";
constexpr std::size_t kLongestCase = 1 << 20;
constexpr int kMostFiles = 100000;

/// The last word of a line, with * for the digits of a step: there a file's name stands. Empty for a line of
/// one word.
std::string lastWord(std::string_view line) {
    const std::size_t end = line.find_last_not_of(kSpaces);
    if (end == std::string_view::npos) return {};
    line = line.substr(0, end + 1);
    const std::size_t space = line.find_last_of(kSpaces);
    return space == std::string_view::npos ? std::string() : std::string(line.substr(space + 1));
}

std::vector<std::filesystem::path> filesNamed(const std::string& casePath, std::string name) {
    std::replace(name.begin(), name.end(), '*', '?');
    glob_t found{};
    std::vector<std::filesystem::path> files;
    if (::glob((std::filesystem::path(casePath).parent_path() / name).c_str(), 0, nullptr, &found) == 0)
        files.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
    ::globfree(&found);
    return files;
}

/// 0 for a folder: the last word of a line need not mean a file.
std::int64_t checkedSize(const std::string& casePath, const std::filesystem::path& file) {
    std::error_code error;
    const std::filesystem::file_status status = std::filesystem::status(file, error);
    if (std::filesystem::is_other(status))
        throw InputError(casePath + ": names " + file.string() + ", which isn't a regular file");
    if (!std::filesystem::is_regular_file(status)) return 0;
    const auto bytes = std::filesystem::file_size(file, error);
    return error ? 0 : std::int64_t(bytes);
}

bool isBinary(InputFile& file) {
    const std::string head = file.copy(0, 84);  // a line of 80, after the length that Fortran gives a record
    return head.find("C Binary") != std::string::npos || head.find("Fortran Binary") != std::string::npos;
}

/// Text ends with a line break, and all that binary files hold takes a multiple of 4 bytes.
std::vector<std::string> findCutOff(const std::vector<std::filesystem::path>& paths) {
    std::vector<std::string> cutOff;
    bool binary = false;  // the head of the geometry says so, those of the variables don't
    for (const std::filesystem::path& path : paths) {
        InputFile file(path.string());
        binary = binary || isBinary(file);
    }
    for (const std::filesystem::path& path : paths) {
        InputFile file(path.string());
        const bool whole = binary ? file.size() % 4 == 0 : file.copy(file.size() - 1, 1) == "\n";
        if (!whole)
            cutOff.push_back(path.filename().string() + " looks cut off: it ends within a " +
                             (binary ? "number." : "line."));
    }
    return cutOff;
}

}  // namespace

EnSightCase checkEnSightCase(const std::string& path) {
    InputFile file(path);
    EnSightCase found;
    found.bytes = std::int64_t(file.size());
    std::vector<std::filesystem::path> data;
    const std::string text = file.copy(0, kLongestCase);
    int files = 0;
    for (std::string_view rest = text; !rest.empty() && files < kMostFiles;) {
        const std::string_view line = rest.substr(0, rest.find('\n'));
        rest.remove_prefix(std::min(line.size() + 1, rest.size()));
        const std::string name = lastWord(line);
        if (name.empty()) continue;
        for (const std::filesystem::path& named : filesNamed(path, name)) {
            const std::int64_t bytes = checkedSize(path, named);
            found.bytes += bytes;
            if (bytes > 0) data.push_back(named);
            if (++files == kMostFiles) break;
        }
    }
    found.warnings = findCutOff(data);
    return found;
}

}  // namespace tessera
