#include "library/program.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string_view>

#include "gl/gl_platform.h"
#include "reader/isolated_reader.h"
#include "tessera/read.h"

namespace tessera {

namespace {

std::string& knownProgram() {
    static std::string path;
    return path;
}

std::string programInPath() {
    const char* folders = std::getenv("PATH");
    std::string_view rest = folders ? folders : "";
    while (!rest.empty()) {
        const std::string_view folder = rest.substr(0, rest.find(':'));
        rest.remove_prefix(std::min(rest.size(), folder.size() + 1));
        const std::string path = std::string(folder.empty() ? "." : folder) + "/tessera";
        if (isProgram(path)) return path;
    }
    return {};
}

}  // namespace

void useProgram(const char* path) {
    knownProgram() = path;
}

bool isProgram(const std::string& path) {
    std::error_code error;
    return std::filesystem::is_regular_file(path, error) && ::access(path.c_str(), X_OK) == 0;
}

std::string findProgram() {
    return isProgram(knownProgram()) ? knownProgram() : programInPath();
}

void tryDriversFor(const std::string& algorithm, std::int64_t maxMemoryBytes) {
    if (algorithm == "software") return;
    const std::string program = findProgram();
    if (program.empty()) return;
    const std::string quick = quickReaderBeside(program);
    tryGlFirst({.executable = quick.empty() ? program : quick,
                .arguments = {kTryGlCommand},
                .maxMemoryBytes = maxMemoryBytes});
}

}  // namespace tessera
