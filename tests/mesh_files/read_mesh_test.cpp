#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <set>

#include "mesh/field_range.h"
#include "mesh_files/read_mesh.h"
#include "mesh_files/write_tets.h"
#include "mesh_test_tools.h"
#include "tessera/error.h"
#include "vtu_text.h"

namespace tessera {
namespace {

using test::countFaceUsers;
using test::countInverted;
using test::sumOfVolumes;
using test::TemporaryFolder;
using test::VtuText;

MeshFile read(const std::string& path, const ReadOptions& options = {}) {
    MeshFile file = readMesh(path, options, {});
    checkMesh(file.mesh);
    EXPECT_EQ(file.statistics.nodes, file.mesh.nodeCount());
    EXPECT_EQ(file.statistics.elements, file.mesh.elementCount());
    EXPECT_EQ(file.statistics.inverted, countInverted(file.mesh));
    return file;
}

const Field& field(const MeshFile& file, const std::string& name) {
    const int index = file.mesh.findField(name);
    if (index < 0) throw std::runtime_error("no field " + name);
    return file.mesh.fields[std::size_t(index)];
}

void expectRange(const MeshFile& file, const std::string& name, int component, double min, double max) {
    const ValueRange range = fieldRange(field(file, name), component);
    EXPECT_NEAR(range.min, min, 1e-5 * std::fabs(min) + 1e-12) << name;
    EXPECT_NEAR(range.max, max, 1e-5 * std::fabs(max) + 1e-12) << name;
}

// Bundled meshes; counts, volumes and ranges from their SOURCE.txt.

TEST(BundledData, StokesSphere) {
    const MeshFile file = read(TESSERA_DATA_DIR "/freefem-stokes-sphere/stokes_p1.vtu");
    EXPECT_EQ(file.statistics.format, "VTK XML unstructured grid");
    EXPECT_EQ(file.statistics.cells, 18598);
    EXPECT_EQ(file.statistics.skippedCells, 1156);  // boundary triangles
    EXPECT_EQ(file.statistics.elements, 18598);
    EXPECT_EQ(file.statistics.nodes, 3306);
    EXPECT_EQ(file.statistics.boundaryFaces, 1156);
    EXPECT_EQ(file.statistics.flat + file.statistics.inverted + file.statistics.duplicate +
                  file.statistics.nonConformingFaces + file.statistics.coincidentNodes,
              0);
    EXPECT_NEAR(sumOfVolumes(file.mesh), 1999.99949, 1e-5);
    EXPECT_NEAR(file.statistics.smallestVolumeWorld, 2.03906e-07, 1e-12);
    EXPECT_NEAR(file.statistics.largestVolumeWorld, 2.88233, 1e-5);
    expectRange(file, "pressure", 0, -31.1263, 30.1926);
    expectRange(file, "velocity", 1, -0.145402, 0.144941);
    EXPECT_EQ(field(file, "Label").location, FieldLocation::cell);
    EXPECT_TRUE(file.statistics.warnings.empty());
}

TEST(BundledData, CavityOfQuadraticTets) {
    const MeshFile file = read(TESSERA_DATA_DIR "/ccx-cavity/cavity.vtu");
    EXPECT_EQ(file.statistics.higherOrderCells, 25535);
    EXPECT_EQ(file.statistics.cellsOfKind[std::size_t(CellKind::tet)], 25535);
    EXPECT_TRUE(file.statistics.warnings.empty());  // the count says it
    EXPECT_LT(file.statistics.nodes, 35069);        // nodes in the middle of edges are gone
    EXPECT_EQ(field(file, "S").components, 6);
    EXPECT_NEAR(sumOfVolumes(file.mesh), 999999.999, 1e-3);
    EXPECT_NEAR(file.statistics.smallestVolumeWorld, 4.5878e-08, 1e-12);
}

TEST(BundledData, FicheraCornerOfCubicTets) {
    const MeshFile file = read(TESSERA_DATA_DIR "/dolfinx-fichera-p3/fichera_p3.vtu");
    EXPECT_EQ(file.statistics.higherOrderCells, 1964);
    EXPECT_NEAR(sumOfVolumes(file.mesh), 7, 1e-12);
    EXPECT_EQ(file.statistics.nonConformingFaces, 0);
}

TEST(BundledData, DiskOfHexahedra) {
    const MeshFile file = read(TESSERA_DATA_DIR "/disk_out_ref/disk_out_ref.vtu");
    EXPECT_EQ(file.statistics.cells, 7472);
    EXPECT_EQ(file.statistics.inverted + file.statistics.flat, 0);
    EXPECT_EQ(file.statistics.nonConformingFaces, 0);
    EXPECT_EQ(file.mesh.fields.size(), 7u);
    // The volume of warped hexahedra depends on their diagonals a little.
    EXPECT_NEAR(sumOfVolumes(file.mesh), 1629.72653, 0.2);
    for (const auto& [face, users] : countFaceUsers(file.mesh)) ASSERT_LE(users, 2);
    expectRange(file, "Temp", 0, 293.15, 913.15);
}

struct SharedMesh {
    const char* path;
    std::int64_t cells;
    double volume;     // sum of |volumes|
    double tolerance;  // relative
    std::int64_t inverted;
};

class SharedData : public testing::TestWithParam<SharedMesh> {};

TEST_P(SharedData, HasTheVolumeOfItsSource) {
    const std::string path = std::string(TESSERA_SHARED_DATA_DIR "/") + GetParam().path;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "there is no " << path;
    const MeshFile file = read(path);
    EXPECT_EQ(file.statistics.cells, GetParam().cells);
    EXPECT_NEAR(sumOfVolumes(file.mesh), GetParam().volume, GetParam().tolerance * GetParam().volume);
    if (GetParam().inverted >= 0) {
        EXPECT_EQ(file.statistics.inverted, GetParam().inverted);
    }
}

INSTANTIATE_TEST_SUITE_P(
    Meshes, SharedData,
    testing::Values(
        SharedMesh{"bluntfin/bluntfin_tets.vtu", 187395, 931.162696, 1e-9, 0},
        SharedMesh{"bluntfin/bluntfin.vts", 37479, 931.162696, 1e-8, 0},
        SharedMesh{"cylinder-p1p2/CylinderLinear.vtu", 1522, 3.05608209e-05, 1e-8, 0},
        SharedMesh{"cylinder-p1p2/CylinderQuadratic.vtu", 1522, 3.05608209e-05, 1e-8, 0},
        SharedMesh{"freefem-stokes-sphere/stokes_p2.vtu", 18598, 1999.99949, 1e-8, 0},
        // Warped faces: the volume depends on their diagonals, by 0.4 % between OpenFOAM's and VTK's own.
        SharedMesh{"openfoam-igloo-poly/igloo_poly.vtu", 11401, 129.682873, 2e-3, -1},
        SharedMesh{"openfoam-igloo-poly/igloo_decomp.vtu", 42888, 129.682873, 2e-3, -1},
        SharedMesh{"svfsi-beam-tet10/result_100.vtu", 9670, 6.25, 1e-6, 9670},
        SharedMesh{"svfsi-pipe-flow/init_flow.vtu", 170694, 375.327157, 1e-8, 170694},
        SharedMesh{"ugawg-hemisphere-cylinder/hsc-gmsh-26-adapt.vtu", 102604, 1031424.83, 1e-8, 0},
        SharedMesh{"utah-torso/utahtorso-lowres.vtu", 51419, 34427214.1, 1e-8, 0},
        SharedMesh{"vtk-small/AngularSector.vtu", 7776, 0.00048837715, 1e-6, 0},
        SharedMesh{"vtk-small/QuadraticTetra.vtu", 96, 8, 1e-7, 0},
        SharedMesh{"vtk-small/Tetrahedron.vtu", 96, 8, 1e-7, 0},
        // 2 tets of 1/6, voxel and hex of 1, wedges of 1/2 (in the order that VTK's documentation does not
        // give), pyramids of 1/3.
        SharedMesh{"vtk-small/elements.vtu", 8, 4, 1e-7, 0},
        SharedMesh{"vtk-small/tetra.vtu", 1, 0.133333335, 1e-7, 0},
        SharedMesh{"vtk-small/tetraMesh.vtk", 160, 2359.722, 1e-6, 80},
        SharedMesh{"vtk-small/uGridEx.vtk", 4, 2.33333333, 1e-7, 0}),
    [](const auto& parameter) {
        std::string name = std::filesystem::path(parameter.param.path).filename().string();
        for (char& c : name)
            if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
        return name;
    });

TEST(SharedBluntfin, HasTheFacesOfTheLiterature) {
    const std::string path = TESSERA_SHARED_DATA_DIR "/bluntfin/bluntfin_tets.vtu";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "there is no " << path;
    const MeshFile file = read(path);
    EXPECT_EQ(file.statistics.flat, 77);
    EXPECT_EQ(file.statistics.boundaryFaces, 13516);
    EXPECT_EQ(file.statistics.coincidentNodes, 39);
    EXPECT_EQ(file.statistics.nonConformingFaces, 0);
    std::int64_t inner = 0;
    for (const auto& [face, users] : countFaceUsers(file.mesh)) inner += users == 2;
    EXPECT_EQ(inner, 368032);
    // Boundary faces for the nearest point: counted plainly among the elements that aren't flat.
    TetMesh solid;
    solid.points = file.mesh.points;
    for (std::int64_t e = 0; e < file.mesh.elementCount(); ++e)
        if (test::signOf(file.mesh, e) != 0) solid.tets.push_back(file.mesh.tets[std::size_t(e)]);
    std::size_t lone = 0;
    for (const auto& [face, users] : countFaceUsers(solid)) lone += users == 1;
    EXPECT_EQ(boundaryFaces(file.mesh, 2).size(), lone);
    EXPECT_EQ(boundaryFaces(file.mesh, 1).size(), lone);
}

TEST(SharedPipeFlow, KeepsTheUntouchedFieldsAndNodes) {
    const std::string path = TESSERA_SHARED_DATA_DIR "/svfsi-pipe-flow/init_flow.vtu";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "there is no " << path;
    const MeshFile file = read(path, {{"WSS", "Pressure"}, -1});
    EXPECT_EQ(file.mesh.fields.size(), 2u);
    expectRange(file, "Pressure", 0, 1232.35, 1398.47);
}

// Formats, with small files written here.

VtuText twoTets() {
    VtuText vtu;
    vtu.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}};
    vtu.cells = {{10, {0, 1, 2, 3}}, {10, {1, 2, 3, 4}}};
    return vtu;
}

TEST(ReadVtu, KeepsFieldsOfEveryNumericType) {
    const TemporaryFolder folder;
    VtuText vtu = twoTets();
    const char* types[] = {"Int8",   "UInt8", "Int16",  "UInt16",  "Int32",
                           "UInt32", "Int64", "UInt64", "Float32", "Float64"};
    for (const char* type : types) vtu.pointArrays.push_back({type, type, 1, "1 2 3 4 5"});
    vtu.pointArrays.push_back({"nine", "Float64", 9, VtuText::numbers(45)});
    vtu.cellArrays.push_back({"region", "Int32", 1, "7 8"});
    vtu.cellArrays.push_back({"flow", "Float64", 3, "1 2 3 4 5 6"});
    const MeshFile file = read(folder.write("a.vtu", vtu.text()));
    for (const char* type : types)
        EXPECT_EQ(field(file, type).values, (std::vector<double>{1, 2, 3, 4, 5})) << type;
    EXPECT_EQ(field(file, "nine").components, 9);
    EXPECT_EQ(field(file, "nine").at(4, 8), 44);
    EXPECT_EQ(field(file, "region").values, (std::vector<double>{7, 8}));
    EXPECT_EQ(field(file, "flow").at(1, 2), 6);
    EXPECT_EQ(file.mesh.points[4], Vec3d(1, 1, 1));
}

TEST(ReadVtu, KeepsCoordinatesInDouble) {
    const TemporaryFolder folder;
    VtuText vtu = twoTets();
    vtu.points[4] = {0.1234567890123456, 1 + 1e-15, 1};
    const MeshFile file = read(folder.write("a.vtu", vtu.text()));
    EXPECT_EQ(file.mesh.points[4].x, 0.1234567890123456);
    EXPECT_EQ(file.mesh.points[4].y, 1 + 1e-15);
}

TEST(ReadVtu, DropsUnusedNodesAndKeepsTheOrder) {
    const TemporaryFolder folder;
    VtuText vtu;
    vtu.points = {{9, 9, 9}, {0, 0, 0}, {1, 0, 0}, {NAN, 0, 0}, {0, 1, 0}, {0, 0, 1}, {8, 8, 8}};
    vtu.cells = {{10, {1, 2, 4, 5}}};
    vtu.pointArrays.push_back({"f", "Float64", 1, "0 10 20 30 40 50 60"});
    const MeshFile file = read(folder.write("a.vtu", vtu.text()));
    EXPECT_EQ(file.mesh.nodeCount(), 4);
    EXPECT_EQ(field(file, "f").values, (std::vector<double>{10, 20, 40, 50}));
    EXPECT_EQ(file.mesh.tets[0], (std::array<std::int32_t, 4>{0, 1, 2, 3}));
}

TEST(ReadVtu, GivesACellsFieldToItsTets) {
    const TemporaryFolder folder;
    VtuText vtu;
    for (int k = 0; k < 2; ++k)
        for (int j = 0; j < 2; ++j)
            for (int i = 0; i < 3; ++i) vtu.points.push_back(Vec3d(i, j, k));
    vtu.cells = {{3, {0, 1}}, {12, {0, 1, 4, 3, 6, 7, 10, 9}}, {11, {1, 2, 4, 5, 7, 8, 10, 11}}};
    vtu.cellArrays.push_back({"c", "Float32", 1, "1 2 3"});
    const MeshFile file = read(folder.write("a.vtu", vtu.text()));
    EXPECT_EQ(file.statistics.skippedCells, 1);
    EXPECT_EQ(file.mesh.elementCount(), 12);
    double integral = 0;
    for (std::int64_t e = 0; e < 12; ++e) integral += field(file, "c").at(e, 0) * signedVolume(file.mesh, e);
    EXPECT_NEAR(integral, 5, 1e-14);
    EXPECT_EQ(file.statistics.boundaryFaces, 20);
    EXPECT_EQ(file.statistics.nonConformingFaces, 0);
}

TEST(ReadVtu, LeavesOutGhostAndHiddenCells) {
    const TemporaryFolder folder;
    VtuText vtu = twoTets();
    vtu.cellArrays.push_back({"vtkGhostType", "UInt8", 1, "0 1"});
    vtu.cellArrays.push_back({"c", "Float64", 1, "5 6"});
    MeshFile file = read(folder.write("duplicate.vtu", vtu.text()));
    EXPECT_EQ(file.statistics.blankedCells, 1);
    EXPECT_EQ(file.mesh.nodeCount(), 4);
    EXPECT_EQ(file.mesh.findField("vtkGhostType"), -1);
    EXPECT_EQ(field(file, "c").values, std::vector<double>{5});

    vtu.cellArrays[0].values = "32 0";
    file = read(folder.write("hidden.vtu", vtu.text()));
    EXPECT_EQ(field(file, "c").values, std::vector<double>{6});

    vtu.cellArrays.erase(vtu.cellArrays.begin());
    vtu.pointArrays.push_back({"vtkGhostType", "UInt8", 1, "2 0 0 0 0"});  // node 0 is hidden
    file = read(folder.write("point.vtu", vtu.text()));
    EXPECT_EQ(field(file, "c").values, std::vector<double>{6});
}

TEST(ReadVtu, ReadsPolyhedraAndPrisms) {
    const TemporaryFolder folder;
    VtuText vtu;
    for (int k = 0; k < 2; ++k)
        for (int j = 0; j < 2; ++j)
            for (int i = 0; i < 2; ++i) vtu.points.push_back(Vec3d(i, j, k));
    vtu.cells = {{42, {0, 1, 2, 3, 4, 5, 6, 7}}};
    vtu.faces = "6 4 0 4 6 2 4 1 3 7 5 4 0 1 5 4 4 2 6 7 3 4 0 2 3 1 4 4 5 7 6";
    vtu.faceOffsets = "31";
    EXPECT_NEAR(sumOfVolumes(read(folder.write("poly.vtu", vtu.text())).mesh), 1, 1e-14);

    VtuText prism;
    for (int k = 0; k < 2; ++k)
        for (int i = 0; i < 6; ++i)
            prism.points.push_back({std::cos(i * M_PI / 3), std::sin(i * M_PI / 3), double(k)});
    prism.cells = {{16, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}}};
    MeshFile file = read(folder.write("hexagonal.vtu", prism.text()));
    EXPECT_NEAR(sumOfVolumes(file.mesh), 1.5 * std::sqrt(3), 1e-12);
    EXPECT_EQ(file.statistics.inverted, 0);
    prism.cells = {{15, {0, 1, 2, 3, 4, 6, 7, 8, 9, 10}}};
    file = read(folder.write("pentagonal.vtu", prism.text()));
    EXPECT_NEAR(sumOfVolumes(file.mesh), 1.25 * std::sqrt(3), 1e-12);
    EXPECT_EQ(file.statistics.inverted, 0);
}

TEST(ReadVtu, RenamesACellFieldThatHasThePointFieldsName) {
    const TemporaryFolder folder;
    VtuText vtu = twoTets();
    vtu.pointArrays.push_back({"T", "Float64", 1, "1 2 3 4 5"});
    vtu.cellArrays.push_back({"T", "Float64", 1, "6 7"});
    const std::string path = folder.write("a.vtu", vtu.text());
    EXPECT_EQ(field(read(path), "T").location, FieldLocation::point);
    EXPECT_EQ(field(read(path), "T_cell").location, FieldLocation::cell);
    const MeshFile one = read(path, {{"T_cell"}, -1});
    ASSERT_EQ(one.mesh.fields.size(), 1u);
    EXPECT_EQ(one.mesh.fields[0].values, (std::vector<double>{6, 7}));
    EXPECT_EQ(read(path, {{"T"}, -1}).mesh.fields.size(), 1u);
    EXPECT_EQ(field(read(path, {{"cell:T"}, -1}), "T_cell").values, (std::vector<double>{6, 7}));
    EXPECT_EQ(read(path, {{"point:T"}, -1}).mesh.fields[0].location, FieldLocation::point);
    EXPECT_EQ(read(path, {{"point:T", "cell:T"}, -1}).mesh.fields.size(), 2u);
    EXPECT_THROW(read(path, {{"cell:T_point"}, -1}), InputError);
}

TEST(ReadVtu, WarnsAboutFieldsItLeavesOut) {
    const TemporaryFolder folder;
    VtuText vtu = twoTets();
    vtu.pointArrays.push_back({"ten", "Float64", 10, VtuText::numbers(50)});
    vtu.pointArrays.push_back({"label", "String", 1, "97 0 98 0 99 0 100 0 101 0"});
    vtu.pointArrays.push_back({"f", "Float64", 1, "1 2 3 4 5"});
    const MeshFile file = read(folder.write("a.vtu", vtu.text()));
    ASSERT_EQ(file.mesh.fields.size(), 1u);
    ASSERT_EQ(file.statistics.warnings.size(), 2u);
    EXPECT_NE(file.statistics.warnings[0].find("'ten'"), std::string::npos);
    EXPECT_NE(file.statistics.warnings[1].find("'label'"), std::string::npos);
}

TEST(ReadVtu, KeepsNotANumberInFields) {
    const TemporaryFolder folder;
    VtuText vtu = twoTets();
    vtu.pointArrays.push_back({"f", "Float64", 1, "1 nan 3 4 5"});
    const MeshFile file = read(folder.write("a.vtu", vtu.text()));
    EXPECT_TRUE(std::isnan(field(file, "f").values[1]));
    EXPECT_EQ(field(file, "f").values[4], 5);
}

TEST(ReadPvtu, MergesPiecesAndLeavesOutGhosts) {
    const TemporaryFolder folder;
    VtuText a = twoTets(), b = twoTets();
    for (VtuText* piece : {&a, &b}) {
        piece->pointArrays.push_back({"f", "Float64", 1, "1 2 3 4 5"});
        piece->cellArrays.push_back({"vtkGhostType", "UInt8", 1, piece == &a ? "0 0" : "0 1"});
    }
    for (Vec3d& p : b.points) p.x += 10;
    folder.write("a.vtu", a.text());
    folder.write("b.vtu", b.text());
    const std::string path =
        folder.write("all.pvtu",
                     "<?xml version=\"1.0\"?>\n<VTKFile type=\"PUnstructuredGrid\" version=\"0.1\" "
                     "byte_order=\"LittleEndian\">\n"
                     "<PUnstructuredGrid GhostLevel=\"1\"><PPointData><PDataArray type=\"Float64\" "
                     "Name=\"f\"/></PPointData>"
                     "<PCellData><PDataArray type=\"UInt8\" Name=\"vtkGhostType\"/></PCellData>"
                     "<PPoints><PDataArray type=\"Float64\" NumberOfComponents=\"3\"/></PPoints>"
                     "<Piece Source=\"a.vtu\"/><Piece Source=\"b.vtu\"/></PUnstructuredGrid></VTKFile>\n");
    const MeshFile file = read(path);
    EXPECT_EQ(file.statistics.cells, 3);
    EXPECT_EQ(file.statistics.blankedCells, 1);
    EXPECT_EQ(field(file, "f").values, (std::vector<double>{1, 2, 3, 4, 5, 1, 2, 3, 4}));
}

TEST(ReadPvtu, PieceNamesMayHoldEntities) {
    const TemporaryFolder folder;
    for (const char* name : {"a&b <1>.vtu", "'it's\".vtu", "\u00fc\u20ac\U0001F600.vtu", "x.vtu&amp"})
        folder.write(name, twoTets().text());
    const std::string path = folder.write(
        "all.pvtu",
        "<VTKFile type=\"PUnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\"><PUnstructuredGrid>"
        "<PPoints><PDataArray type=\"Float64\" NumberOfComponents=\"3\"/></PPoints>"
        "<Piece Source=\"a&amp;b &lt;&#49;&gt;.vtu\"/><Piece Source=\"&apos;it's&quot;.vtu\"/>"
        "<Piece Source=\"&#xfc;&#x20AC;&#128512;.vtu\"/><Piece Source=\"x.vtu&#38;amp\"/>"
        "</PUnstructuredGrid></VTKFile>\n");
    EXPECT_EQ(read(path).statistics.cells, 8);
}

TEST(ReadMultiBlock, MergesBlocksAndFillsAbsentFields) {
    const TemporaryFolder folder;
    VtuText a = twoTets(), b = twoTets();
    a.pointArrays.push_back({"f", "Float64", 1, "1 2 3 4 5"});
    b.pointArrays.push_back({"g", "Float64", 2, VtuText::numbers(10)});
    b.cellArrays.push_back({"c", "Float64", 1, "8 9"});
    for (Vec3d& p : b.points) p.x += 10;
    folder.write("a.vtu", a.text());
    folder.write("b.vtu", b.text());
    const std::string path = folder.write("all.vtm",
                                          "<?xml version=\"1.0\"?>\n<VTKFile type=\"vtkMultiBlockDataSet\" "
                                          "version=\"1.0\"><vtkMultiBlockDataSet>"
                                          "<DataSet index=\"0\" file=\"a.vtu\"/><Block index=\"1\"><DataSet "
                                          "index=\"0\" file=\"b.vtu\"/></Block>"
                                          "</vtkMultiBlockDataSet></VTKFile>\n");
    const MeshFile file = read(path);
    EXPECT_EQ(file.statistics.blocks, 2);
    EXPECT_EQ(file.mesh.elementCount(), 4);
    EXPECT_EQ(file.mesh.nodeCount(), 10);
    ASSERT_EQ(file.statistics.warnings.size(), 1u);
    EXPECT_NE(file.statistics.warnings[0].find("3 fields are absent in some blocks"), std::string::npos);
    EXPECT_NE(file.statistics.warnings[0].find("f, g, c"), std::string::npos);
    EXPECT_EQ(field(file, "f").at(4, 0), 5);
    EXPECT_TRUE(std::isnan(field(file, "f").at(5, 0)));
    EXPECT_TRUE(std::isnan(field(file, "g").at(4, 1)));
    EXPECT_EQ(field(file, "g").at(9, 1), 9);
    EXPECT_TRUE(std::isnan(field(file, "c").at(1, 0)));
    EXPECT_EQ(field(file, "c").at(3, 0), 9);
    EXPECT_EQ(file.mesh.points[std::size_t(file.mesh.tets[3][3])], Vec3d(11, 1, 1));
}

TEST(ReadLegacy, ReadsEveryKindOfGrid) {
    const TemporaryFolder folder;
    const std::string head = "# vtk DataFile Version 3.0\ntitle\nASCII\n";
    const std::string values = "POINT_DATA 8\nSCALARS f double 1\nLOOKUP_TABLE default\n0 1 2 3 4 5 6 7\n";
    const auto expectCube = [&](const std::string& name, const std::string& body, double volume) {
        const MeshFile file = read(folder.write(name, head + body + values));
        EXPECT_EQ(file.mesh.elementCount(), 6) << name;
        EXPECT_EQ(file.statistics.inverted, 0) << name;
        EXPECT_NEAR(sumOfVolumes(file.mesh), volume, 1e-12) << name;
        EXPECT_EQ(field(file, "f").values, (std::vector<double>{0, 1, 2, 3, 4, 5, 6, 7})) << name;
    };
    const std::string cube = "0 0 0 1 0 0 0 1 0 1 1 0 0 0 1 1 0 1 0 1 1 1 1 1\n";
    expectCube("points.vtk", "DATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 1 2 3\nSPACING 1 2 3\n", 6);
    expectCube("grid.vtk", "DATASET STRUCTURED_GRID\nDIMENSIONS 2 2 2\nPOINTS 8 double\n" + cube, 1);
    expectCube("rectilinear.vtk",
               "DATASET RECTILINEAR_GRID\nDIMENSIONS 2 2 2\nX_COORDINATES 2 double\n0 4\nY_COORDINATES 2 "
               "double\n0 1\n"
               "Z_COORDINATES 2 double\n1 2\n",
               4);
    expectCube("unstructured.vtk",
               "DATASET UNSTRUCTURED_GRID\nPOINTS 8 double\n" + cube +
                   "CELLS 1 9\n8 0 1 3 2 4 5 7 6\nCELL_TYPES 1\n12\n",
               1);
}

TEST(ReadStructured, LeavesOutBlankedCells) {
    const TemporaryFolder folder;
    const std::string path =
        folder.write("blank.vti",
                     "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" "
                     "byte_order=\"LittleEndian\" header_type=\"UInt64\">"
                     "<ImageData WholeExtent=\"0 2 0 1 0 1\" Origin=\"0 0 0\" Spacing=\"1 1 1\"><Piece "
                     "Extent=\"0 2 0 1 0 1\">"
                     "<PointData/><CellData><DataArray type=\"UInt8\" Name=\"vtkGhostType\" "
                     "format=\"ascii\">0 32</DataArray>"
                     "<DataArray type=\"Float64\" Name=\"c\" format=\"ascii\">3 "
                     "4</DataArray></CellData></Piece></ImageData></VTKFile>\n");
    const MeshFile file = read(path);
    EXPECT_EQ(file.statistics.cells, 1);
    EXPECT_EQ(file.statistics.blankedCells, 1);
    EXPECT_EQ(field(file, "c").values, std::vector<double>(6, 3.0));
    EXPECT_NEAR(sumOfVolumes(file.mesh), 1, 1e-14);
}

class ReadTetgen : public testing::TestWithParam<int> {};

TEST_P(ReadTetgen, ReadsBothIndexBasesFromEitherFile) {
    const int base = GetParam();
    const TemporaryFolder folder;
    const auto index = [&](int i) { return std::to_string(i + base) + " "; };
    folder.write("m.node", "# made by hand\n\n5 3 2 1\n" + index(0) + "0 0 0 1.5 10 1\n" + index(1) +
                               "1 0 0 2.5 20 1 # comment\n" + index(2) + " 0 1.0e0 0 3.5 30 0\n" + index(3) +
                               "\t0 0 +1 4.5 40 0\r\n" + index(4) + "1 1 1 5.5 50 0");
    folder.write("m.ele", "2 4 1\n" + index(0) + index(0) + index(1) + index(2) + index(3) + "7\n#\n" +
                              index(1) + index(1) + index(2) + index(3) + index(4) + "-2\n");
    for (const char* name : {"m.node", "m.ele"}) {
        const MeshFile file = read(folder.file(name));
        EXPECT_EQ(file.statistics.format, "TetGen");
        EXPECT_EQ(file.mesh.tets, (std::vector<std::array<std::int32_t, 4>>{{0, 1, 2, 3}, {1, 2, 3, 4}}));
        EXPECT_EQ(field(file, "attribute_1").values, (std::vector<double>{1.5, 2.5, 3.5, 4.5, 5.5}));
        EXPECT_EQ(field(file, "attribute_2").values, (std::vector<double>{10, 20, 30, 40, 50}));
        EXPECT_EQ(field(file, "region").values, (std::vector<double>{7, -2}));
        EXPECT_EQ(file.mesh.points[4], Vec3d(1, 1, 1));
    }
}

INSTANTIATE_TEST_SUITE_P(Base, ReadTetgen, testing::Values(0, 1));

TEST(ReadTetgen, ReadsTheCornersOfTenNodeElements) {
    const TemporaryFolder folder;
    folder.write("q.node",
                 "10 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 .5 .5 0\n6 0 .5 0\n7 .5 0 0\n8 0 0 .5\n9 "
                 ".5 0 .5\n10 0 .5 .5\n");
    folder.write("q.ele", "1 10 0\n1 1 2 3 4 5 6 7 8 9 10\n");
    const MeshFile file = read(folder.file("q.ele"));
    EXPECT_EQ(file.statistics.higherOrderCells, 1);
    EXPECT_EQ(file.mesh.nodeCount(), 4);
    EXPECT_TRUE(file.statistics.warnings.empty());
}

TEST(ReadEnSight, ReadsAsciiGold) {
    const TemporaryFolder folder;
    const std::string path = folder.write(
        "m.case",
        "FORMAT\ntype: ensight gold\n\nGEOMETRY\nmodel: m.geo\n\nVARIABLE\nscalar per node: T m.T\n");
    folder.write(
        "m.geo",
        "title\nmore\nnode id assign\nelement id assign\npart\n         1\nblock\ncoordinates\n         4\n"
        " 0.00000e+00\n 1.00000e+00\n 0.00000e+00\n 0.00000e+00\n 0.00000e+00\n 0.00000e+00\n 1.00000e+00\n "
        "0.00000e+00\n"
        " 0.00000e+00\n 0.00000e+00\n 0.00000e+00\n 1.00000e+00\ntetra4\n         1\n         1         2    "
        "     3         4\n");
    folder.write("m.T",
                 "temperature\npart\n         1\ncoordinates\n 1.00000e+00\n 2.00000e+00\n 3.00000e+00\n "
                 "4.00000e+00\n");
    const MeshFile file = read(path);
    EXPECT_EQ(file.statistics.format, "EnSight");
    EXPECT_NEAR(sumOfVolumes(file.mesh), 1.0 / 6, 1e-7);
    EXPECT_EQ(field(file, "T").values, (std::vector<double>{1, 2, 3, 4}));
}

TEST(ReadOpenFoam, ReadsACaseWithItsLastTime) {
    const TemporaryFolder folder;
    std::filesystem::create_directories(folder.file("constant/polyMesh"));
    std::filesystem::create_directories(folder.file("system"));
    std::filesystem::create_directories(folder.file("0"));
    std::filesystem::create_directories(folder.file("1"));
    const auto head = [](const std::string& kind, const std::string& object) {
        return "FoamFile\n{\n    version 2.0;\n    format ascii;\n    class " + kind +
               ";\n    location \"\";\n    object " + object + ";\n}\n";
    };
    folder.write("system/controlDict",
                 head("dictionary", "controlDict") +
                     "startTime 0;\nendTime 1;\ndeltaT 1;\nwriteInterval 1;\nwriteControl timeStep;\n");
    folder.write("constant/polyMesh/points",
                 head("vectorField", "points") +
                     "12\n(\n(0 0 0)\n(1 0 0)\n(2 0 0)\n(0 1 0)\n(1 1 0)\n(2 1 0)\n(0 0 1)\n(1 0 1)\n(2 0 "
                     "1)\n(0 1 1)\n(1 1 1)\n(2 1 1)\n)\n");
    folder.write("constant/polyMesh/faces", head("faceList", "faces") +
                                                "11\n(\n4(1 4 10 7)\n4(0 6 9 3)\n4(0 1 7 6)\n4(3 9 10 "
                                                "4)\n4(0 3 4 1)\n4(6 7 10 9)\n4(2 5 11 8)\n4(1 2 8 7)\n"
                                                "4(4 10 11 5)\n4(1 4 5 2)\n4(7 8 11 10)\n)\n");
    folder.write("constant/polyMesh/owner",
                 head("labelList", "owner") + "11\n(\n0\n0\n0\n0\n0\n0\n1\n1\n1\n1\n1\n)\n");
    folder.write("constant/polyMesh/neighbour", head("labelList", "neighbour") + "1\n(\n1\n)\n");
    folder.write("constant/polyMesh/boundary",
                 head("polyBoundaryMesh", "boundary") +
                     "1\n(\nwall\n{\n    type wall;\n    nFaces 10;\n    startFace 1;\n}\n)\n");
    for (const char* time : {"0", "1"})
        folder.write(std::string(time) + "/T",
                     head("volScalarField", "T") +
                         "dimensions [0 0 0 1 0 0 0];\ninternalField nonuniform List<scalar>\n2\n(\n" +
                         (time[0] == '0' ? "1\n2\n" : "30\n40\n") +
                         ")\n;\nboundaryField\n{\nwall\n{\ntype zeroGradient;\n}\n}\n");
    const MeshFile file = read(folder.write("case.foam", ""));
    EXPECT_EQ(file.statistics.format, "OpenFOAM");
    EXPECT_EQ(file.statistics.cells, 2);
    EXPECT_NEAR(sumOfVolumes(file.mesh), 2, 1e-12);
    EXPECT_EQ(file.statistics.inverted, 0);
    expectRange(file, "T", 0, 30, 40);
    expectRange(read(folder.file("case.foam"), {{}, 0}), "T", 0, 1, 2);
}

TEST(WriteTets, ReadsBackBitForBit) {
    const TemporaryFolder folder;
    const MeshFile file = read(TESSERA_DATA_DIR "/freefem-stokes-sphere/stokes_p1.vtu");
    writeTets(file.mesh, folder.file("tets.vtu"), {});
    const MeshFile again = read(folder.file("tets.vtu"));
    EXPECT_EQ(again.mesh.points, file.mesh.points);
    EXPECT_EQ(again.mesh.tets, file.mesh.tets);
    ASSERT_EQ(again.mesh.fields.size(), file.mesh.fields.size());
    for (const Field& expected : file.mesh.fields) {
        EXPECT_EQ(field(again, expected.name).values, expected.values);
        EXPECT_EQ(field(again, expected.name).location, expected.location);
    }
    EXPECT_THROW(writeTets(file.mesh, folder.file("absent/tets.vtu"), {}), IoError);
    EXPECT_FALSE(std::filesystem::exists(folder.file("absent")));
}

}  // namespace
}  // namespace tessera
