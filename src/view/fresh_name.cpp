#include "view/fresh_name.h"

#include <filesystem>
#include <system_error>

namespace tessera {

namespace {

/// A link that leads nowhere is something too. What can't be looked at is told when it is written.
bool isThere(const std::filesystem::path& path) {
    std::error_code ignored;
    return std::filesystem::exists(std::filesystem::symlink_status(path, ignored));
}

}  // namespace

std::string freshName(const std::string& path) {
    const std::filesystem::path asked = path;
    std::filesystem::path fresh = asked;
    for (int number = 2; isThere(fresh); ++number)
        fresh.replace_filename(asked.stem().string() + "-" + std::to_string(number) +
                               asked.extension().string());
    return fresh.string();
}

}  // namespace tessera
