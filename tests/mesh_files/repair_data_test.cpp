#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "base/timer.h"
#include "mesh/mesh_quality.h"
#include "mesh/repair.h"
#include "mesh_files/read_mesh.h"
#include "mesh_test_tools.h"

// Real meshes: those in data/, and further ones where ../shared/data is there.

namespace tessera {
namespace {

struct RealMesh {
    std::string folder, file;
};
const RealMesh kBundled[] = {{"freefem-stokes-sphere", "stokes_p1.vtu"},
                             {"ccx-cavity", "cavity.vtu"},
                             {"dolfinx-fichera-p3", "fichera_p3.vtu"},
                             {"disk_out_ref", "disk_out_ref.vtu"}};
const RealMesh kShared[] = {{"bluntfin", "bluntfin.vts"},
                            {"bluntfin", "bluntfin_tets.vtu"},
                            {"ugawg-hemisphere-cylinder", "hsc-gmsh-26-adapt.vtu"},
                            {"openfoam-igloo-poly", "igloo_poly.vtu"},
                            {"openfoam-igloo-poly", "igloo_decomp.vtu"},
                            {"cylinder-p1p2", "CylinderLinear.vtu"},
                            {"svfsi-beam-tet10", "result_100.vtu"},
                            {"svfsi-pipe-flow", "init_flow.vtu"},
                            {"utah-torso", "utahtorso-lowres.vtu"},
                            {"vtk-small", "AngularSector.vtu"},
                            {"vtk-small", "elements.vtu"},
                            {"vtk-small", "tetraMesh.vtk"},
                            {"vtk-small", "uGridEx.vtk"}};

void printCounts(const char* when, const ClassCounts& counts) {
    std::printf("  %s:", when);
    for (std::size_t c = 1; c < kElementClasses; ++c)
        std::printf(" %s %lld", nameOf(ElementClass(c)), static_cast<long long>(counts.of[c]));
    std::printf("\n");
}

void printThinness(const TetMesh& mesh) {
    double thinnest = 1;
    std::vector<double> aspects;
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) aspects.push_back(aspectOf(cornersOf(mesh, e)));
    for (const double aspect : aspects)
        if (aspect > 1e-12) thinnest = std::min(thinnest, aspect);
    std::printf("  smallest aspect ratio above 1e-12: %.3g; below 1e-2 1e-3 1e-4 1e-5 1e-6:", thinnest);
    for (const double limit : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6})
        std::printf(" %lld", static_cast<long long>(std::count_if(aspects.begin(), aspects.end(),
                                                                  [&](double a) { return a < limit; })));
    std::printf("\n");
}

/// @param path is known to exist.
void expectRepaired(const std::string& path, double minAspect) {
    SCOPED_TRACE(path + " below " + std::to_string(minAspect));
    const TetMesh mesh = readMesh(path, {}, {}).mesh;
    RepairOptions options;
    options.limits.minAspect = minAspect;
    RepairReport report;
    Timer timer;
    const TetMesh repaired = repair(mesh, options, report, {});
    std::printf(
        "  below %g: elements %lld > %lld, inverted %lld, volume change %.2g, moved %.2g, %.0f ms, "
        "operations %lld %lld %lld %lld, dropped %lld, flat %lld (%lld unmatched), kept %lld\n",
        minAspect, static_cast<long long>(report.elementsBefore),
        static_cast<long long>(report.elementsAfter), static_cast<long long>(report.inverted),
        report.relativeVolumeChange(), report.boundaryDeviationWorld, timer.elapsedMs(),
        static_cast<long long>(report.collapses), static_cast<long long>(report.edgeSplits),
        static_cast<long long>(report.edgePairSplits), static_cast<long long>(report.faceSplits),
        static_cast<long long>(report.dropped), static_cast<long long>(report.droppedFlat),
        static_cast<long long>(report.unmatchedFlat), static_cast<long long>(report.keptElements()));
    printCounts("before", report.before);
    printCounts("after", report.after);
    ASSERT_NO_THROW(checkMesh(repaired));
    const MeshQuality was = measureQuality(mesh, {}), is = measureQuality(repaired, {});
    std::printf("  boundary faces %lld > %lld, non-conforming faces %lld > %lld\n",
                static_cast<long long>(was.boundaryFaces), static_cast<long long>(is.boundaryFaces),
                static_cast<long long>(was.nonConformingFaces),
                static_cast<long long>(is.nonConformingFaces));
    EXPECT_LE(is.nonConformingFaces, was.nonConformingFaces);
    EXPECT_EQ(test::countInverted(repaired), 0);
    EXPECT_LE(report.relativeVolumeChange(), 1e-6);
    EXPECT_FALSE(report.rangesGrew());
    EXPECT_EQ(countClasses(repaired, options.limits, {}).degenerate(), report.keptElements());
    if (minAspect == ClassLimits{}.minAspect) {
        EXPECT_EQ(report.keptElements(), 0);
    }
    if (report.before.degenerate() == 0) {
        EXPECT_EQ(repaired.points, mesh.points);
        EXPECT_EQ(repaired.elementCount(), mesh.elementCount());
    }
}

void expectRepaired(const std::string& root, const RealMesh& real) {
    const std::string path = root + "/" + real.folder + "/" + real.file;
    ASSERT_TRUE(std::filesystem::exists(path)) << path;
    std::printf("%s/%s\n", real.folder.c_str(), real.file.c_str());
    printThinness(readMesh(path, {}, {}).mesh);
    expectRepaired(path, ClassLimits{}.minAspect);
    expectRepaired(path, 1e-3);
}

TEST(RepairData, MakesTheBundledMeshesSound) {
    for (const RealMesh& real : kBundled) expectRepaired(TESSERA_DATA_DIR, real);
}

TEST(RepairData, MakesFurtherRealMeshesSound) {
    if (!std::filesystem::exists(TESSERA_SHARED_DATA_DIR))
        GTEST_SKIP() << "no further meshes: " << TESSERA_SHARED_DATA_DIR << " isn't there";
    for (const RealMesh& real : kShared) expectRepaired(TESSERA_SHARED_DATA_DIR, real);
}

}  // namespace
}  // namespace tessera
