#include "files/temporary_folder.h"

#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "tessera/error.h"

namespace tessera {

namespace fs = std::filesystem;

TemporaryFolder::TemporaryFolder(const std::string& prefix) {
    std::error_code error;
    const fs::path parent = fs::temp_directory_path(error);
    if (error)
        throw IoError("there is no folder for temporary files: " + error.message() +
                      "; TMPDIR in the environment names one");
    path_ = (parent / (prefix + "XXXXXX")).string();
    if (!::mkdtemp(path_.data()))
        throw IoError("can't make a temporary folder in " + parent.string() + ": " + std::strerror(errno));
}

TemporaryFolder::~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
}

}  // namespace tessera
