#include "mesh_files/foam_check.h"

#include <charconv>
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "tessera/error.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;

std::vector<fs::path> foldersIn(const fs::path& folder) {
    std::vector<fs::path> found;
    std::error_code error;
    for (fs::directory_iterator i(folder, error), end; !error && i != end; i.increment(error)) {
        std::error_code ignored;
        if (i->is_directory(ignored)) found.push_back(i->path());
    }
    return found;
}

/// The latest time that a case has a folder of, and the folder's name; empty without any.
std::pair<double, std::string> latestTime(const fs::path& folder) {
    std::pair<double, std::string> latest;
    for (const fs::path& path : foldersIn(folder)) {
        const std::string name = path.filename().string();
        double time = 0;
        const auto [end, failure] = std::from_chars(name.data(), name.data() + name.size(), time);
        if (failure != std::errc{} || end != name.data() + name.size() || !std::isfinite(time)) continue;
        if (latest.second.empty() || time > latest.first) latest = {time, name};
    }
    return latest;
}

bool hasMesh(const fs::path& folder) {
    std::error_code ignored;
    return fs::exists(folder / "polyMesh/faces", ignored) ||
           fs::exists(folder / "polyMesh/faces.gz", ignored);
}

/// Whether there is a mesh of the whole case: constant, or of a time, of all or of a region.
bool hasWholeMesh(const fs::path& folder) {
    for (const fs::path& candidate : foldersIn(folder)) {
        if (candidate.filename().string().starts_with("processor")) continue;
        if (hasMesh(candidate)) return true;
        for (const fs::path& region : foldersIn(candidate))
            if (hasMesh(region)) return true;
    }
    return false;
}

}  // namespace

std::vector<std::string> checkFoamCase(const std::string& path) {
    fs::path folder = fs::path(path).parent_path();
    if (folder.empty()) folder = ".";
    std::pair<double, std::string> ofParts;
    std::string part;
    for (const fs::path& candidate : foldersIn(folder)) {
        if (!candidate.filename().string().starts_with("processor")) continue;
        const auto latest = latestTime(candidate);
        if (ofParts.second.empty() || (!latest.second.empty() && latest.first > ofParts.first))
            ofParts = latest;
        part = candidate.filename().string();
    }
    if (part.empty()) return {};
    if (!hasWholeMesh(folder))
        throw InputError(path + ": the case is decomposed: its mesh is in parts (" + part +
                         "); join them first, with reconstructPar");
    const auto ofCase = latestTime(folder);
    if (ofParts.second.empty() || (!ofCase.second.empty() && ofParts.first <= ofCase.first)) return {};
    return {"The parts that a parallel run left have times up to " + ofParts.second +
            ", the whole case, which is read, up to " + (ofCase.second.empty() ? "none" : ofCase.second) +
            "; reconstructPar joins them."};
}

}  // namespace tessera
