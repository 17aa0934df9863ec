#include "mesh_files/ensight_check.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <utility>
#include <vector>

#include "files/input_file.h"
#include "files/named_file.h"
#include "tessera/error.h"

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

/// Those in one folder whose names are `pattern` with any one character for each *.
std::vector<std::filesystem::path> filesLike(const std::filesystem::path& folder,
                                             const std::string& pattern) {
    std::vector<std::filesystem::path> files;
    std::error_code error;
    int looked = 0;
    for (std::filesystem::directory_iterator entry(folder.empty() ? "." : folder, error), end;
         !error && entry != end && looked < kMostFiles; entry.increment(error), ++looked) {
        const std::string name = entry->path().filename().string();
        const bool fits = name.size() == pattern.size() &&
                          std::equal(name.begin(), name.end(), pattern.begin(),
                                     [](char c, char like) { return c == like || like == '*'; });
        if (fits) files.push_back(folder / name);
    }
    std::sort(files.begin(), files.end());
    return files;
}

std::vector<std::filesystem::path> filesNamed(const std::string& casePath, const std::string& name,
                                              const std::optional<std::string>& folder) {
    const std::filesystem::path path = std::filesystem::path(casePath).parent_path() / name;
    const std::string pattern = path.filename().string();
    if (pattern.find('*') == std::string::npos) return {path};
    // What lies elsewhere can't be listed by a process that has given that up.
    std::error_code error;
    if (folder && std::filesystem::is_directory(path.parent_path(), error))
        checkInFolder(*folder, casePath, path.parent_path().string());
    return filesLike(path.parent_path(), pattern);
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

/// The first bytes of a file and its last one; empty when it can't be read.
struct Ends {
    std::string head, tail;
};
Ends endsOf(const std::string& path) {
    constexpr std::streamsize kHead = 84;  // a line of 80, after the length that Fortran gives a record
    std::ifstream file(path, std::ios::binary);
    Ends ends{std::string(std::size_t(kHead), '\0'), std::string(1, '\0')};
    file.read(ends.head.data(), kHead);
    ends.head.resize(std::size_t(file.gcount()));
    file.clear();
    file.seekg(-1, std::ios::end);
    file.read(ends.tail.data(), 1);
    return file ? ends : Ends{};
}

}  // namespace

EnSightCase checkEnSightCase(const std::string& path, const std::optional<std::string>& folder) {
    InputFile file(path);
    EnSightCase found;
    found.bytes = std::int64_t(file.size());
    const std::string text = file.copy(0, kLongestCase);
    int files = 0;
    for (std::string_view rest = text; !rest.empty() && files < kMostFiles;) {
        const std::string_view line = rest.substr(0, rest.find('\n'));
        rest.remove_prefix(std::min(line.size() + 1, rest.size()));
        const std::string name = lastWord(line);
        if (name.empty()) continue;
        for (const std::filesystem::path& named : filesNamed(path, name, folder)) {
            const std::int64_t bytes = checkedSize(path, named);
            if (bytes > 0 && folder) checkInFolder(*folder, path, named.string());
            found.bytes += bytes;
            if (bytes > 0) found.named.emplace(named.string(), bytes);
            if (++files == kMostFiles) break;
        }
    }
    return found;
}

std::vector<std::string> findCutOffFiles(const EnSightCase& files) {
    std::vector<Ends> ends;
    bool binary = false;  // the head of the geometry says so, those of the variables don't
    for (const auto& [path, bytes] : files.named) {
        ends.push_back(endsOf(path));
        const std::string& head = ends.back().head;
        binary = binary || head.find("C Binary") != std::string::npos ||
                 head.find("Fortran Binary") != std::string::npos;
    }
    std::vector<std::string> cutOff;
    std::size_t i = 0;
    for (const auto& [path, bytes] : files.named) {
        const std::string& tail = ends[i++].tail;
        if (!tail.empty() && (binary ? bytes % 4 != 0 : tail != "\n"))
            cutOff.push_back(std::filesystem::path(path).filename().string());
    }
    if (cutOff.empty()) return {};
    const std::string others = cutOff.size() > 1 ? " and " + std::to_string(cutOff.size() - 1) + " more" : "";
    return {cutOff.front() + others + " may be cut off: " + (others.empty() ? "it ends" : "they end") +
            " within a " + (binary ? "number." : "line.")};
}

}  // namespace tessera
