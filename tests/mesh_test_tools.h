#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <unistd.h>

#include "mesh/geometry.h"
#include "tessera/mesh.h"

namespace tessera::test {

/// How many elements use each face, by sorted node indices.
inline std::map<std::array<std::int32_t, 3>, int> countFaceUsers(const TetMesh& mesh) {
    std::map<std::array<std::int32_t, 3>, int> users;
    for (const auto& tet : mesh.tets) {
        for (std::size_t skip = 0; skip < 4; ++skip) {
            std::array<std::int32_t, 3> face{};
            std::size_t count = 0;
            for (std::size_t i = 0; i < 4; ++i)
                if (i != skip) face[count++] = tet[i];
            std::sort(face.begin(), face.end());
            ++users[face];
        }
    }
    return users;
}

inline double sumOfVolumes(const TetMesh& mesh) {
    double sum = 0;
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) sum += std::fabs(signedVolume(mesh, e));
    return sum;
}

inline int signOf(const TetMesh& mesh, std::int64_t e) {
    const auto& t = mesh.tets[std::size_t(e)];
    return volumeSign(mesh.points[std::size_t(t[0])], mesh.points[std::size_t(t[1])],
                      mesh.points[std::size_t(t[2])], mesh.points[std::size_t(t[3])]);
}

inline std::int64_t countInverted(const TetMesh& mesh) {
    std::int64_t inverted = 0;
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) inverted += signOf(mesh, e) < 0;
    return inverted;
}

/// A directory of its own for one test, removed at the end.
class TemporaryFolder {
  public:
    TemporaryFolder() {
        static int count = 0;
        path_ = std::filesystem::temp_directory_path() /
                ("tessera_test_" + std::to_string(::getpid()) + "_" + std::to_string(count++));
        std::filesystem::create_directories(path_);
    }
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    std::string file(const std::string& name) const { return (path_ / name).string(); }
    std::string write(const std::string& name, const std::string& content) const {
        std::ofstream(file(name), std::ios::binary) << content;
        return file(name);
    }

  private:
    std::filesystem::path path_;
};

}  // namespace tessera::test
