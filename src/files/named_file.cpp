#include "files/named_file.h"

#include <algorithm>
#include <filesystem>

#include "base/text.h"
#include "tessera/error.h"

namespace tessera {

void checkInFolder(const std::string& folder, const std::string& by, const std::string& named) {
    namespace fs = std::filesystem;
    std::error_code noFolder, noPlace;
    const fs::path root = fs::weakly_canonical(folder, noFolder),
                   place = fs::weakly_canonical(named, noPlace);
    if (!noFolder && !noPlace && !root.empty() &&
        std::mismatch(root.begin(), root.end(), place.begin(), place.end()).first == root.end())
        return;
    throw InputError(by + ": names " + named + ", which lies outside the folder " + folder +
                     kFollowLinksHint);
}

std::string extensionOf(const std::string& path) {
    return lowerCase(std::filesystem::path(path).extension().string());
}

std::string folderOf(const std::string& path) {
    const std::string folder = std::filesystem::path(path).parent_path().string();
    return folder.empty() ? "." : folder;
}

}  // namespace tessera
