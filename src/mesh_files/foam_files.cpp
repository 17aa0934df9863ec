#include "mesh_files/foam_files.h"

#include <zlib.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <memory>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "files/named_file.h"
#include "tessera/error.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kWhole = std::numeric_limits<std::size_t>::max(), kBeginning = 1 << 16;
constexpr std::size_t kPieceBytes = 1 << 20, kLongestInclude = 1 << 13;
constexpr int kDeepestFolder = 3, kDeepestInclude = 8;
constexpr std::string_view kFoamSpaces = " \t\r\n\v\f";

bool isTimeFolder(const std::string& name) {
    return name.find_first_not_of("0123456789+-.eE") == std::string::npos;
}

class FoamFiles {
  public:
    FoamFiles(const std::string& path, const std::optional<std::string>& folder)
        : path_(path), root_(folderOf(path)), folder_(folder) {}

    void checkAll();
    void checkTime(double time);

  private:
    std::vector<fs::path> entriesOf(const fs::path& folder);
    void checkFile(const fs::path& file, std::size_t searched);
    void checkFolder(const fs::path& folder, std::size_t searched, int depth);
    void checkMeshes(const fs::path& folder, std::size_t searched);
    void searchMesh(const fs::path& mesh, const std::string& region);
    void search(const fs::path& file, std::size_t most);
    void checkDirective(const fs::path& file, std::string_view text);
    void checkInclude(const fs::path& file, const std::string& name);
    void checkPlace(const fs::path& place) const {
        if (folder_) checkInFolder(*folder_, path_, place.string());
    }

    const std::string& path_;
    const fs::path root_;
    const std::optional<std::string> folder_;
    std::set<std::string> searched_;  ///< files that were searched as a whole
    std::set<std::string> meshes_;    ///< regions whose points, or faces, were found
    int depth_ = 0;                   ///< of files that include others
};

/// What a folder holds; a link to one counts by where it leads.
std::vector<fs::path> FoamFiles::entriesOf(const fs::path& folder) {
    std::vector<fs::path> entries;
    std::error_code error;
    if (!fs::is_directory(folder, error)) return entries;
    checkPlace(folder);
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
        entries.push_back(entry->path());
    return entries;
}

void FoamFiles::checkFile(const fs::path& file, std::size_t searched) {
    std::error_code error;
    const fs::file_status status = fs::status(file, error);
    if (!fs::exists(status) || fs::is_directory(status)) return;
    if (!fs::is_regular_file(status))
        throw InputError(path_ + ": " + file.string() + " isn't a regular file");
    if (!folder_) return;
    checkPlace(file);
    search(file, searched);
}

void FoamFiles::checkFolder(const fs::path& folder, std::size_t searched, int depth) {
    for (const fs::path& entry : entriesOf(folder)) {
        std::error_code error;
        if (!fs::is_directory(entry, error))
            checkFile(entry, searched);
        else if (depth > 0)
            checkFolder(entry, searched, depth - 1);
    }
}

/// The mesh of a folder, and those of the regions in it.
void FoamFiles::checkMeshes(const fs::path& folder, std::size_t searched) {
    checkFolder(folder / "polyMesh", searched, 0);
    for (const fs::path& region : entriesOf(folder)) {
        std::error_code error;
        if (fs::is_directory(region / "polyMesh", error)) checkFolder(region / "polyMesh", searched, 0);
    }
}

void FoamFiles::checkAll() {
    checkFile(root_ / "system/controlDict", kWhole);
    checkMeshes(root_ / "constant", kWhole);
    for (const fs::path& entry : entriesOf(root_))
        if (isTimeFolder(entry.filename().string())) checkFolder(entry, kBeginning, kDeepestFolder);
}

/// Points and faces are those of the latest time that has any.
void FoamFiles::searchMesh(const fs::path& mesh, const std::string& region) {
    const auto has = [&](const std::string& name) {
        std::error_code error;
        return fs::exists(mesh / name, error) || fs::exists(mesh / (name + ".gz"), error);
    };
    if (has("faces") && meshes_.insert("faces/" + region).second) checkFolder(mesh, kWhole, 0);
    if (!has("points") || !meshes_.insert("points/" + region).second) return;
    checkFile(mesh / "points", kWhole);
    checkFile(mesh / "points.gz", kWhole);
}

void FoamFiles::checkTime(double time) {
    std::vector<std::pair<double, fs::path>> times;
    for (const fs::path& entry : entriesOf(root_)) {
        const std::string name = entry.filename().string();
        if (isTimeFolder(name)) times.emplace_back(std::strtod(name.c_str(), nullptr), entry);
    }
    std::sort(times.rbegin(), times.rend());
    for (const auto& [when, folder] : times) {
        if (when > time) continue;
        if (when == time) checkFolder(folder, kWhole, kDeepestFolder);
        searchMesh(folder / "polyMesh", "");
        for (const fs::path& region : entriesOf(folder))
            searchMesh(region / "polyMesh", region.filename().string());
    }
}

/// Searches a file, packed or not, for #include. @param most bytes from its beginning.
void FoamFiles::search(const fs::path& file, std::size_t most) {
    if (most == kWhole && !searched_.insert(file.string()).second) return;
    const std::unique_ptr<gzFile_s, int (*)(gzFile)> input(::gzopen(file.c_str(), "rbe"), ::gzclose);
    if (!input) return;  // the reader will say so
    std::string text;
    std::size_t done = 0;
    for (bool isEnd = false; !isEnd && done < most;) {
        const std::size_t kept = text.size();
        text.resize(kept + kPieceBytes);
        const int got =
            ::gzread(input.get(), text.data() + kept, unsigned(std::min(kPieceBytes, most - done)));
        text.resize(kept + std::size_t(std::max(0, got)));
        done += std::size_t(std::max(0, got));
        isEnd = got <= 0 || done >= most;
        const std::size_t sure = isEnd ? text.size() : text.size() - std::min(text.size(), kLongestInclude);
        for (std::size_t at = text.find('#'); at < sure; at = text.find('#', at + 1))
            checkDirective(file, std::string_view(text).substr(at + 1, kLongestInclude));
        text.erase(0, sure);
    }
}

/// @param text from behind the '#'.
void FoamFiles::checkDirective(const fs::path& file, std::string_view text) {
    text.remove_prefix(std::min(text.find_first_not_of(kFoamSpaces), text.size()));
    const std::string_view word =
        text.substr(0, text.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"));
    // VTK's reader leaves out #includeEtc and #includeFunc, which name files of OpenFOAM itself.
    const bool isKnown = word == "include" || word == "includeIfPresent" || word == "sinclude";
    if (!isKnown) return;
    text.remove_prefix(word.size());
    text.remove_prefix(std::min(text.find_first_not_of(kFoamSpaces), text.size()));
    if (text.empty()) return;
    if (text.front() == '"') {
        const std::size_t close = text.find('"', 1);
        if (close != std::string_view::npos)
            return checkInclude(file, std::string(text.substr(1, close - 1)));
    }
    throw InputError(file.string() + ": has an #include without the name of a file in quotes");
}

void FoamFiles::checkInclude(const fs::path& file, const std::string& name) {
    if (name.find_first_of("$<\\\n") != std::string::npos || name.starts_with('~'))
        throw InputError(file.string() + ": includes " + name + ", which can be any file" + kFollowLinksHint);
    const fs::path included = name.starts_with('/') ? fs::path(name) : file.parent_path() / name;
    checkInFolder(*folder_, file.string(), included.string());
    if (depth_ == kDeepestInclude)
        throw InputError(file.string() + ": files include each other more than 8 deep");
    ++depth_;
    checkFile(included, kWhole);
    --depth_;
}

}  // namespace

void checkFoamFiles(const std::string& path, const std::optional<std::string>& folder) {
    FoamFiles(path, folder).checkAll();
}

void checkFoamTime(const std::string& path, const std::string& folder, double time) {
    FoamFiles(path, folder).checkTime(time);
}

}  // namespace tessera
