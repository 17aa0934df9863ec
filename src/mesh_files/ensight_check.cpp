#include "mesh_files/ensight_check.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "files/input_file.h"
#include "files/named_file.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::string_view kSpaces = " \t\r\n\v\f";
constexpr std::size_t kLongestCase = 16 << 20;
constexpr std::size_t kMostFiles = 1000000, kMostListed = 10000000;

/// Calls `use` with each word.
template <class Use>
void forEachWord(std::string_view text, const Use& use) {
    while (true) {
        text.remove_prefix(std::min(text.find_first_not_of(kSpaces), text.size()));
        if (text.empty()) return;
        const std::string_view word = text.substr(0, text.find_first_of(kSpaces));
        use(word);
        text.remove_prefix(word.size());
    }
}

/// Whether the name is the pattern with any characters for each *.
bool fits(std::string_view name, std::string_view pattern) {
    std::size_t n = 0, p = 0, star = std::string_view::npos, behindStar = 0;
    while (n < name.size()) {
        if (p < pattern.size() && pattern[p] == '*') {
            star = p++;
            behindStar = n;
        } else if (p < pattern.size() && pattern[p] == name[n]) {
            ++p, ++n;
        } else if (star != std::string_view::npos) {
            p = star + 1;
            n = ++behindStar;
        } else {
            return false;
        }
    }
    return pattern.find_first_not_of('*', p) == std::string_view::npos;
}

/// What the words of a case name.
class NamedFiles {
  public:
    NamedFiles(const std::string& casePath, const std::optional<std::string>& folder)
        : casePath_(casePath), folder_(folder) {}

    std::vector<std::string> find(std::string_view word) {
        found_.clear();
        // As VTK's reader has it: behind the case's folder, whatever the name begins with.
        const std::string parent = std::filesystem::path(casePath_).parent_path().string();
        addFiles(parent.empty() ? "" : parent + "/", word);
        if (word.starts_with('/')) addFiles("", word);
        return found_;
    }

  private:
    /// Adds what fits, one folder of the name after the other.
    void addFiles(const std::string& before, std::string_view rest) {
        const std::size_t star = rest.find('*');
        if (star == std::string_view::npos) {
            found_.push_back(before + std::string(rest));
            return;
        }
        const std::size_t slash = rest.find_last_of('/', star);
        const std::size_t begin = slash == std::string_view::npos ? 0 : slash + 1;
        const std::string place = before + std::string(rest.substr(0, begin));
        const std::string_view behind = rest.substr(begin), pattern = behind.substr(0, behind.find('/'));
        std::error_code error;
        // What lies elsewhere can't be listed by a process that has given that up.
        if (folder_ && std::filesystem::is_directory(place.empty() ? "." : place, error))
            checkInFolder(*folder_, casePath_, place.empty() ? "." : place);
        for (std::filesystem::directory_iterator entry(place.empty() ? "." : place, error), end;
             !error && entry != end; entry.increment(error)) {
            if (++listed_ > kMostListed) throw InputError(casePath_ + ": its patterns fit too many files");
            const std::string name = entry->path().filename().string();
            if (fits(name, pattern)) addFiles(place + name, behind.substr(pattern.size()));
        }
    }

    const std::string& casePath_;
    const std::optional<std::string>& folder_;
    std::vector<std::string> found_;
    std::size_t listed_ = 0;
};

/// Nothing for a folder, or where no file is: not every word means one.
std::optional<std::int64_t> checkedSize(const std::string& casePath, const std::string& file) {
    std::error_code error;
    const std::filesystem::file_status status = std::filesystem::status(file, error);
    if (std::filesystem::is_other(status))
        throw InputError(casePath + ": names " + file + ", which isn't a regular file");
    if (!std::filesystem::is_regular_file(status)) return std::nullopt;
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
    if (text.size() < file.size())
        throw InputError(path + ": an EnSight case file of more than 16 MiB isn't read");
    if (text.find('\0') != std::string::npos)
        throw InputError(path + ": isn't an EnSight case file: it has a byte of zero");
    NamedFiles files(path, folder);
    forEachWord(text, [&](std::string_view word) {
        for (const std::string& named : files.find(word)) {
            const std::optional<std::int64_t> bytes = checkedSize(path, named);
            if (!bytes) continue;
            if (folder) checkInFolder(*folder, path, named);
            if (*bytes == 0 || !found.named.emplace(named, *bytes).second) continue;
            found.bytes += *bytes;
            if (found.named.size() > kMostFiles) throw InputError(path + ": names too many files");
        }
    });
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
