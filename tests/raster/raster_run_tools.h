#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <mutex>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "contract_suite.h"
#include "gl_test_tools.h"
#include "raster/raster_device.h"
#include "reference/fields.h"
#include "reference/generators.h"
#include "tessera/lattice.h"
#include "tessera/registry.h"

// What the tests of running OpenGL resamplers share.

namespace tessera::rastertest {

/// A jittered box with fields of 1, 3 and 1 components in the unit cube.
inline TetMesh smallMesh(int cells = 3, std::uint64_t seed = 5) {
    TetMesh mesh = boxMesh({.cells = Vec3i(cells), .jitter = 0.25, .seed = seed});
    addPointField(mesh, "wavy", {wavyField});
    addRandomField(mesh, "vector", FieldLocation::point, 3, 0, 1, seed);
    addElementIdField(mesh, "element");
    return mesh;
}

/// The unit cube in `points` a side; index 0 lies in it, so a box about it takes eight regions.
inline Lattice centredLattice(int points) {
    return Lattice::axisParallel(Vec3d(0.5), 1.0 / points);
}
inline IndexBox centredBox(int points) {
    return {Vec3i(-points / 2 - 1), Vec3i(points / 2 + 2)};
}

struct Sampled {
    std::vector<Block> blocks;
    ResampleStatistics statistics;
};

inline Sampled sampleBound(BoundResampler& bound, const Lattice& lattice, std::span<const IndexBox> boxes,
                           const Execution& execution = {.threads = 2}) {
    Sampled sampled;
    sampled.blocks.resize(boxes.size());
    std::vector<int> calls(boxes.size(), 0);
    std::mutex mutex;
    sampled.statistics = bound.resample(
        lattice, boxes,
        [&](std::size_t b, const Block& block) {
            const std::lock_guard lock(mutex);
            sampled.blocks.at(b) = block;
            ++calls.at(b);
        },
        execution);
    for (std::size_t b = 0; b < boxes.size(); ++b) {
        EXPECT_EQ(calls[b], 1) << "every block is given out once";
        EXPECT_EQ(sampled.blocks[b].box, boxes[b]);
    }
    return sampled;
}

inline Sampled sampleOnce(std::string_view algorithm, const TetMesh& mesh, std::span<const int> fields,
                          const BindOptions& options, const Lattice& lattice,
                          std::span<const IndexBox> boxes) {
    const auto bound = namedResampler(algorithm).bind(mesh, fields, options);
    return sampleBound(*bound, lattice, boxes);
}

/// Points whose coverage or bits differ.
inline std::int64_t differences(const std::vector<Block>& a, const std::vector<Block>& b) {
    EXPECT_EQ(a.size(), b.size());
    std::int64_t count = 0;
    for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) count += contract::differences(a[i], b[i]);
    return count;
}

inline std::int64_t residentBytes() {
    std::ifstream file("/proc/self/statm");
    std::int64_t total = 0, resident = 0;
    file >> total >> resident;
    return resident * sysconf(_SC_PAGESIZE);
}

inline std::int64_t liveObjects(GlPlatform platform) {
    return sharedGlThread(platform).run([](GlContext& context) { return context.liveObjects(); });
}

/// Its objects end on the device's thread.
inline std::shared_ptr<RasterDevice> makeDevice(GlPlatform platform) {
    GlThread& thread = sharedGlThread(platform);
    return {new RasterDevice(thread),
            [&thread](RasterDevice* device) { thread.run([device](GlContext&) { delete device; }); }};
}

/// Elements of all grades; sides that lie on lattice planes and nodes on lattice points, where up to 24
/// elements are equally deep; one as large as the region, whose box is cut.
inline TetMesh contestedMesh() {
    TetMesh mesh = boxMesh({.cells = Vec3i(4)});
    mesh.fields.clear();
    appendMesh(mesh, boxMesh({.cells = Vec3i(3), .jitter = 0.25, .seed = 3}));
    appendMesh(mesh, thinTetsMesh(ThinKind::sliver, 1e-5, 0.7, 20, 3));
    appendMesh(mesh, thinTetsMesh(ThinKind::needle, 1e-9, 0.7, 20, 4));
    appendMesh(mesh, thinTetsMesh(ThinKind::sliver, 1e-13, 0.7, 10, 5));
    const auto first = std::int32_t(mesh.points.size());
    for (const Vec3d& point : {Vec3d(0, 0, 0), Vec3d(1, 0.1, 0), Vec3d(0.2, 1, 0.1), Vec3d(0, 0.1, 1)})
        mesh.points.push_back(point);
    mesh.tets.push_back({first, first + 1, first + 2, first + 3});
    addPointField(mesh, "wavy", {wavyField});
    addRandomField(mesh, "vector", FieldLocation::point, 3, 0, 1, 5);
    addHoledCopy(mesh, 0, "holed", 5);
    addElementIdField(mesh, "element");
    return mesh;
}

}  // namespace tessera::rastertest
