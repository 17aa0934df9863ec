#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "base/check.h"
#include "mesh_files/read_mesh.h"
#include "tessera/error.h"
#include "tessera/execution.h"

namespace tessera::fuzz {

inline Execution oneThread() {
    Execution execution;
    execution.threads = 1;
    return execution;
}

/// Runs a parser: it may end or throw InputError with a message, and nothing else.
template <class Run>
void expectInputErrorsOnly(const Run& run) {
    try {
        run();
    } catch (const InputError& error) {
        TESSERA_CHECK(*error.what() != '\0', "a message says something");
    }
}

/// What every reader promises of a mesh.
inline void checkAssembled(const MeshFile& file) {
    checkMesh(file.mesh);
    TESSERA_CHECK(!file.mesh.tets.empty(), "a mesh has elements");
    for (const auto& tet : file.mesh.tets)
        for (const std::int32_t node : tet) {
            const Vec3d& p = file.mesh.points[std::size_t(node)];
            TESSERA_CHECK(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z),
                          "places are finite");
            TESSERA_CHECK(std::count(tet.begin(), tet.end(), node) == 1, "an element has four nodes");
        }
    const ImportStatistics& statistics = file.statistics;
    TESSERA_CHECK(statistics.elements == file.mesh.elementCount(), "all elements are counted");
    TESSERA_CHECK(statistics.flat + statistics.inverted <= statistics.elements,
                  "an element is one or neither");
}

}  // namespace tessera::fuzz
