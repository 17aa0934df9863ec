// One small mesh in the formats of simulation programs.

#include <gtest/gtest.h>
#include <vtk_cgns.h>
#include <vtk_exodusII.h>
#include <vtk_hdf5.h>
#include VTK_CGNS(cgnslib.h)

#include <array>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "mesh/field_range.h"
#include "mesh_files/box_files.h"
#include "mesh_files/open_check.h"
#include "mesh_files/read_mesh.h"
#include "mesh_test_tools.h"
#include "reader/isolated_reader.h"
#include "tessera/error.h"

namespace tessera {
namespace {

using namespace test;

/// Of the cell that the element comes from.
double cellValue(const TetMesh& mesh, std::int64_t e) {
    Vec3d centre{0, 0, 0};
    for (const std::int32_t corner : mesh.tets[std::size_t(e)])
        centre = centre + mesh.points[std::size_t(corner)] * 0.25;
    if (centre.x < 1) return kCellValues[0];
    return (centre.x - 1) + centre.y < 1 ? kCellValues[1] : kCellValues[2];
}

const Field& field(const MeshFile& file, const std::string& name, FieldLocation location) {
    const int index = file.mesh.findField(name);
    if (index < 0) throw std::runtime_error("no field " + name);
    const Field& found = file.mesh.fields[std::size_t(index)];
    EXPECT_EQ(found.location, location) << name;
    return found;
}

void expectTheBox(const MeshFile& file) {
    checkMesh(file.mesh);
    EXPECT_EQ(file.mesh.nodeCount(), kNodes);
    EXPECT_DOUBLE_EQ(sumOfVolumes(file.mesh), 2);
    EXPECT_EQ(countInverted(file.mesh), 0);
    EXPECT_EQ(file.statistics.nonConformingFaces, 0);
    EXPECT_EQ(file.statistics.skippedCells, 0);
    EXPECT_TRUE(file.statistics.warnings.empty()) << file.statistics.warnings.front();
    for (const Vec3d& p : file.mesh.points)
        for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(p[axis], std::round(p[axis]));
}

void expectScalar(const MeshFile& file, const std::string& name, int step) {
    const Field& scalar = field(file, name, FieldLocation::point);
    ASSERT_EQ(scalar.components, 1);
    for (std::int64_t i = 0; i < file.mesh.nodeCount(); ++i)
        EXPECT_EQ(scalar.at(i, 0), scalarAt(file.mesh.points[std::size_t(i)], step));
}

void expectVector(const MeshFile& file, const std::string& name) {
    const Field& vector = field(file, name, FieldLocation::point);
    ASSERT_EQ(vector.components, 3);
    for (std::int64_t i = 0; i < file.mesh.nodeCount(); ++i)
        for (int axis = 0; axis < 3; ++axis)
            EXPECT_EQ(vector.at(i, axis), vectorAt(file.mesh.points[std::size_t(i)])[axis]);
}

void expectCellValues(const MeshFile& file, const std::string& name, double factor = 1) {
    const Field& values = field(file, name, FieldLocation::cell);
    ASSERT_EQ(values.components, 1);
    for (std::int64_t e = 0; e < file.mesh.elementCount(); ++e)
        EXPECT_EQ(values.at(e, 0), factor * cellValue(file.mesh, e));
}

/// Reads in this process and in one of its own, which must tell the same.
MeshFile read(const std::string& path, int step = -1) {
    ReadOptions options;
    options.timeStep = step;
    MeshFile file = readMesh(path, options, {});
    const IsolatedReader reader{TESSERA_MISBEHAVING_READER, {"read"}, TESSERA_QUICK_READER};
    const MeshFile isolated = readMeshIsolated(reader, path, options, {}, {});
    EXPECT_EQ(isolated.statistics.format, file.statistics.format);
    EXPECT_EQ(isolated.mesh.points, file.mesh.points);
    EXPECT_EQ(isolated.mesh.tets, file.mesh.tets);
    EXPECT_EQ(isolated.mesh.fields.size(), file.mesh.fields.size());
    return file;
}

TEST(SolverFormats, Exodus) {
    const TemporaryFolder folder;
    const std::string path = folder.file("box.ex2");
    writeExodus(path, EX_CLOBBER);
    for (const int step : {-1, 0, 1}) {
        const MeshFile file = read(path, step);
        EXPECT_EQ(file.statistics.format, "Exodus II");
        EXPECT_EQ(file.statistics.blocks, 2);
        expectTheBox(file);
        expectScalar(file, "temp", step < 0 ? 1 : step);
        expectVector(file, "vel_");
        expectCellValues(file, "material");
        EXPECT_EQ(file.mesh.fields.size(), 3u);
    }
}

bool holds(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

/// The message that reading is refused with.
std::string refusal(const std::string& path) {
    try {
        readMesh(path, {}, {});
    } catch (const InputError& error) {
        return error.what();
    }
    ADD_FAILURE() << path << " was read";
    return {};
}

TEST(SolverFormats, ExodusRefusesWhatIsCutOff) {
    const TemporaryFolder folder;
    const std::string path = folder.file("box.ex2");
    writeExodus(path, EX_CLOBBER);
    const auto size = std::filesystem::file_size(path);
    std::filesystem::resize_file(path, size - 8);  // the last value of the last step
    EXPECT_PRED2(holds, refusal(path), "cut off: its variables take " + std::to_string(size));
    std::filesystem::resize_file(path, 100);
    EXPECT_PRED2(holds, refusal(path), "box.ex2: damaged");
}

TEST(SolverFormats, ExodusRefusesNodesThatAreNotThere) {
    const TemporaryFolder folder;
    for (const std::int64_t node : {0, 13, 1 << 30}) {
        const std::string path = folder.file("box.ex2");
        writeExodus(path, EX_CLOBBER);
        int computeWord = 8, fileWord = 8;
        float version = 0;
        const int file = ex_open(path.c_str(), EX_WRITE, &computeWord, &fileWord, &version);
        std::array<int, 12> wedges{2, 3, 5, 8, 9, 11, 3, 6, 5, 9, 12, int(node)};
        EXPECT_EQ(ex_put_conn(file, EX_ELEM_BLOCK, 9, wedges.data(), nullptr, nullptr), 0);
        EXPECT_EQ(ex_close(file), 0);
        EXPECT_PRED2(holds, refusal(path),
                     "element 2 of block 2 (both counted from 1) names node " + std::to_string(node));
    }
}

TEST(SolverFormats, ExodusRefusesBlocksOfOneNumber) {
    const TemporaryFolder folder;
    const std::string path = folder.file("box.ex2");
    writeExodus(path, EX_CLOBBER);
    std::ifstream in(path, std::ios::binary);
    std::string bytes((std::istreambuf_iterator<char>(in)), {});
    const std::size_t numbers = bytes.find(std::string("\0\0\0\7\0\0\0\11", 8));
    ASSERT_NE(numbers, std::string::npos);
    bytes.replace(numbers, 8, 8, '\0');
    std::ofstream(path, std::ios::binary) << bytes;
    EXPECT_PRED2(holds, refusal(path), "two of its element blocks have the number 0");
}

TEST(SolverFormats, CgnsUnstructured) {
    const TemporaryFolder folder;
    for (const int kind : {CG_FILE_ADF, CG_FILE_HDF5}) {
        const std::string path = folder.file(kind == CG_FILE_ADF ? "adf.cgns" : "hdf5.cgns");
        writeCgnsUnstructured(path, kind);
        const MeshFile mesh = read(path);
        EXPECT_EQ(mesh.statistics.format, "CGNS");
        expectTheBox(mesh);
        expectScalar(mesh, "Temperature", 0);
        expectVector(mesh, "Velocity");
        expectCellValues(mesh, "Material");
        EXPECT_EQ(mesh.mesh.fields.size(), 3u);
    }
}

TEST(SolverFormats, CgnsStructured) {
    const TemporaryFolder folder;
    const std::string path = folder.file("box.cgns");
    writeCgnsStructured(path, CG_FILE_HDF5);
    const MeshFile mesh = read(path);
    EXPECT_EQ(mesh.statistics.cells, 2);
    expectTheBox(mesh);
    expectScalar(mesh, "Temperature", 0);
    expectVector(mesh, "Velocity");
    const Field& material = field(mesh, "Material", FieldLocation::cell);
    for (std::int64_t e = 0; e < mesh.mesh.elementCount(); ++e)
        EXPECT_EQ(material.at(e, 0), cellValue(mesh.mesh, e) == 10 ? 10 : 20);
}

TEST(SolverFormats, CgnsFieldsOfTheSecondZoneOnly) {
    const TemporaryFolder folder;
    CgnsFile out(folder.file("zones.cgns"), CG_FILE_HDF5);
    const auto& [path, file, base] = out;
    for (const char* name : {"A", "B"}) {
        const std::array<cgsize_t, 9> size{3, 2, 2, 2, 1, 1, 0, 0, 0};
        int zone = 0, written = 0;
        checkCgns(cg_zone_write(file, base, name, size.data(), CGNS_ENUMV(Structured), &zone));
        writeCgnsNodes(file, base, zone);
        if (*name == 'A') continue;
        writeCgnsCells(file, base, zone, {10, 20});
        for (const char* field : {"Pressure", "ForceX", "ForceY", "ForceZ"})
            checkCgns(cg_field_write(file, base, zone, 1, CGNS_ENUMV(RealDouble), field,
                                     nodeValues([](const Vec3d& p) { return p.x; }).data(), &written));
    }
    checkCgns(cg_close(file));

    const MeshFile mesh = read(path);
    EXPECT_EQ(mesh.statistics.cells, 4);
    ASSERT_EQ(mesh.statistics.warnings.size(), 1u);
    EXPECT_PRED2(holds, mesh.statistics.warnings[0], "3 fields are absent");  // in A
    for (const auto& [name, place] : {std::pair("Pressure", FieldLocation::point),
                                      {"Force", FieldLocation::point},
                                      {"Material", FieldLocation::cell}}) {
        const ValueRange range = fieldRange(field(mesh, name, place), 0);
        EXPECT_EQ(range.max, place == FieldLocation::point ? 2 : 20) << name;
    }
    EXPECT_EQ(field(mesh, "Force", FieldLocation::point).components, 3);
}

TEST(SolverFormats, CgnsPolyhedraAreUpright) {
    const TemporaryFolder folder;
    const std::string path = folder.file("box.cgns");
    writeCgnsPolyhedron(path, CG_FILE_HDF5);
    const MeshFile mesh = read(path);
    EXPECT_EQ(mesh.statistics.cells, 1);
    EXPECT_EQ(mesh.statistics.nodes, 8);
    EXPECT_EQ(mesh.statistics.inverted, 0);
    EXPECT_DOUBLE_EQ(sumOfVolumes(mesh.mesh), 1);
    expectScalar(mesh, "Temperature", 0);
}

TEST(SolverFormats, CgnsSeveralSolutionsAreAWarning) {
    const TemporaryFolder folder;
    CgnsFile out(folder.file("solutions.cgns"), CG_FILE_HDF5);
    const auto& [path, file, base] = out;
    const std::array<cgsize_t, 9> size{3, 2, 2, 2, 1, 1, 0, 0, 0};
    int zone = 0, solution = 0, written = 0;
    checkCgns(cg_zone_write(file, base, "Blade", size.data(), CGNS_ENUMV(Structured), &zone));
    writeCgnsNodes(file, base, zone);
    checkCgns(cg_sol_write(file, base, zone, "More", CGNS_ENUMV(Vertex), &solution));
    checkCgns(cg_field_write(file, base, zone, solution, CGNS_ENUMV(RealDouble), "Pressure",
                             nodeValues([](const Vec3d& p) { return p.x; }).data(), &written));
    checkCgns(cg_close(file));
    const MeshFile mesh = read(path);
    ASSERT_EQ(mesh.statistics.warnings.size(), 1u);
    EXPECT_PRED2(holds, mesh.statistics.warnings[0], "Zone 'Blade' has several solutions");
}

TEST(SolverFormats, EnSight) {
    for (const auto version : {EnSightVersion::gold, EnSightVersion::six})
        for (const auto encoding : {Encoding::text, Encoding::binary}) {
            const TemporaryFolder folder;
            const std::string path = writeEnSight(folder.file(""), version, encoding);
            for (const int step : {-1, 0, 1}) {
                const MeshFile file = read(path, step);
                EXPECT_EQ(file.statistics.format, "EnSight");
                expectTheBox(file);
                const int shown = step < 0 ? 1 : step;
                const bool hasScalar = file.mesh.findField("temp") >= 0;
                EXPECT_EQ(hasScalar, version == EnSightVersion::gold || encoding == Encoding::text);
                if (hasScalar) expectScalar(file, "temp", shown);
                expectVector(file, "vel");
                expectCellValues(file, "material", shown + 1);
                EXPECT_EQ(file.mesh.fields.size(), hasScalar ? 3u : 2u);
            }
        }
}

TEST(SolverFormats, EnSightFilesThatLookCutOff) {
    const TemporaryFolder folder;
    const std::string path = writeEnSight(folder.file(""));
    EXPECT_TRUE(readMesh(path, {}, {}).statistics.warnings.empty());
    for (const char* name : {"box.geo", "box.vel"}) {
        writeEnSight(folder.file(""));
        std::filesystem::resize_file(folder.file(name), std::filesystem::file_size(folder.file(name)) - 3);
        const std::vector<std::string> warnings = readMesh(path, {}, {}).statistics.warnings;
        ASSERT_EQ(warnings.size(), 1u);
        EXPECT_PRED2(holds, warnings[0], std::string(name) + " may be cut off");
    }
}

TEST(SolverFormats, OpenFoam) {
    for (const auto encoding : {Encoding::text, Encoding::binary}) {
        const TemporaryFolder folder;
        writeFoamMesh(folder.file(""), "", encoding);
        writeFoamFields(folder.file(""), "", encoding);
        const std::string path = folder.write("box.foam", "");
        for (const int step : {-1, 0, 1}) {
            const MeshFile file = read(path, step);
            EXPECT_EQ(file.statistics.format, "OpenFOAM");
            expectTheBox(file);
            const int shown = step < 0 ? 1 : step;
            expectCellValues(file, "p", shown + 1);
            expectScalar(file, "T", shown);
            const Field& velocity = field(file, "U", FieldLocation::cell);
            ASSERT_EQ(velocity.components, 3);
            for (std::int64_t e = 0; e < file.mesh.elementCount(); ++e)
                for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(velocity.at(e, axis), axis + 1);
            EXPECT_EQ(file.mesh.fields.size(), 3u);
        }
    }
}

TEST(SolverFormats, OpenFoamRegions) {
    const TemporaryFolder folder;
    for (const char* region : {"fluid/", "solid/"}) {
        writeFoamMesh(folder.file(""), region);
        writeFoamFields(folder.file(""), region);
    }
    const MeshFile file = read(folder.write("box.foam", ""));
    EXPECT_EQ(file.statistics.blocks, 2);
    EXPECT_EQ(file.statistics.cells, 6);
    EXPECT_DOUBLE_EQ(sumOfVolumes(file.mesh), 4);
    expectCellValues(file, "p", 2);
    expectScalar(file, "T", 1);
}

TEST(SolverFormats, OpenFoamInParts) {
    const TemporaryFolder folder;
    std::filesystem::create_directories(folder.file("processor0/2.5"));
    const std::string path = folder.write("box.foam", "");
    EXPECT_PRED2(holds, refusal(path), "reconstructPar");
    writeFoamMesh(folder.file(""), "");
    writeFoamFields(folder.file(""), "");
    const MeshFile whole = readMesh(path, {}, {});
    ASSERT_EQ(whole.statistics.warnings.size(), 1u);
    EXPECT_PRED2(holds, whole.statistics.warnings[0], "times up to 2.5");
    std::filesystem::remove(folder.file("processor0/2.5"));
    EXPECT_TRUE(readMesh(path, {}, {}).statistics.warnings.empty());
}

/// A group of HDF5 with a dataset, and whatever `add` puts beside it.
std::string writeHdf5(const TemporaryFolder& folder, const std::string& name,
                      const std::function<void(hid_t file, hid_t space)>& add) {
    const std::string path = folder.file(name);
    const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const hsize_t length = 6;
    const hid_t space = H5Screate_simple(1, &length, nullptr);
    const hid_t group = H5Gcreate2(file, "group", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Dclose(H5Dcreate2(group, "own", H5T_NATIVE_CHAR, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    add(group, space);
    H5Gclose(group);
    H5Sclose(space);
    H5Fclose(file);
    return path;
}

TEST(SolverFormats, FilesThatReadOthersAreRefused) {
    const TemporaryFolder folder;
    folder.write("other", "secret");
    const auto refusal = [](const std::string& path) -> std::string {
        try {
            refuseLinks(path);
        } catch (const InputError& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_EQ(refusal(writeHdf5(folder, "own.ex2",
                                [](hid_t group, hid_t) {
                                    H5Lcreate_soft("/group/own", group, "soft", H5P_DEFAULT, H5P_DEFAULT);
                                })),
              "");
    const std::string linked = writeHdf5(folder, "linked.ex2", [](hid_t group, hid_t) {
        H5Lcreate_external("own.ex2", "/group/own", group, "there", H5P_DEFAULT, H5P_DEFAULT);
    });
    EXPECT_NE(refusal(linked).find("a link to another file, group/there"), std::string::npos);
    const std::string stored = writeHdf5(folder, "stored.cgns", [&](hid_t group, hid_t space) {
        const hid_t plan = H5Pcreate(H5P_DATASET_CREATE);
        H5Pset_external(plan, folder.file("other").c_str(), 0, 6);
        H5Dclose(H5Dcreate2(group, "there", H5T_NATIVE_CHAR, space, H5P_DEFAULT, plan, H5P_DEFAULT));
        H5Pclose(plan);
    });
    EXPECT_NE(refusal(stored).find("values in another file, of group/there"), std::string::npos);
    for (const int type : {CG_FILE_ADF, CG_FILE_HDF5}) {
        const std::string path = folder.file("linked.cgns");
        int file = 0, base = 0;
        std::filesystem::remove(path);
        cg_set_file_type(type);
        ASSERT_EQ(cg_open(path.c_str(), CG_MODE_WRITE, &file), 0);
        ASSERT_EQ(cg_base_write(file, "Base", 3, 3, &base), 0);
        ASSERT_EQ(cg_goto(file, base, "end"), 0);
        ASSERT_EQ(cg_link_write("Grid", "other.cgns", "/Base/Grid"), 0);
        cg_close(file);
        EXPECT_NE(refusal(path).find("a link to another file"), std::string::npos) << type;
        EXPECT_THROW(readMesh(path, {}, {}), InputError);
    }
    cg_set_file_type(CG_FILE_NONE);
}

}  // namespace
}  // namespace tessera
