#pragma once

#include <string>

namespace tessera {

/// Ends a refusal of what a file names.
inline constexpr const char* kFollowLinksHint = "; --follow-links lets files name others anywhere";

/// Throws InputError when a file that another one names lies neither in `folder` nor below it, by where
/// symbolic links lead. @param by what names it.
void checkInFolder(const std::string& folder, const std::string& by, const std::string& named);

/// What a file's name ends with, the dot included, in small letters.
std::string extensionOf(const std::string& path);

/// The folder that a file lies in.
std::string folderOf(const std::string& path);

}  // namespace tessera
