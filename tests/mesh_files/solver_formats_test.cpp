// One small mesh in the formats of simulation programs, as their own libraries write it or by hand.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <vtk_cgns.h>
#include <vtk_exodusII.h>
#include <vtk_hdf5.h>
#include VTK_CGNS(cgnslib.h)

#include <array>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "mesh/field_range.h"
#include "mesh_files/open_check.h"
#include "mesh_files/read_mesh.h"
#include "mesh_test_tools.h"
#include "reader/isolated_reader.h"
#include "tessera/error.h"

namespace tessera {
namespace {

using test::countInverted;
using test::sumOfVolumes;
using test::TemporaryFolder;

// A box of 2 x 1 x 1: a hexahedron, and two wedges beside it that share the face x = 1 with it.

constexpr int kNodes = 12;
constexpr std::array<int, 8> kHexahedron{0, 1, 4, 3, 6, 7, 10, 9};
constexpr std::array<std::array<int, 6>, 2> kWedges{{{1, 2, 4, 7, 8, 10}, {2, 5, 4, 8, 11, 10}}};
constexpr std::array<double, 3> kCellValues{10, 20, 40};

Vec3d node(int i) {
    return {double(i % 3), double(i / 3 % 2), double(i / 6)};
}

double scalarAt(const Vec3d& p, int step) {
    return (1 + p.x + 2 * p.y + 4 * p.z) * (step + 1);
}

Vec3d vectorAt(const Vec3d& p) {
    return {p.x, -p.y, 3 * p.z};
}

/// Of the cell that the element comes from.
double cellValue(const TetMesh& mesh, std::int64_t e) {
    Vec3d centre{0, 0, 0};
    for (const std::int32_t corner : mesh.tets[std::size_t(e)])
        centre = centre + mesh.points[std::size_t(corner)] * 0.25;
    if (centre.x < 1) return kCellValues[0];
    return (centre.x - 1) + centre.y < 1 ? kCellValues[1] : kCellValues[2];
}

std::vector<double> nodeValues(const std::function<double(const Vec3d&)>& value) {
    std::vector<double> values;
    for (int i = 0; i < kNodes; ++i) values.push_back(value(node(i)));
    return values;
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

// Exodus: a block of hexahedra and one of wedges, two steps.

std::string writeExodus(const TemporaryFolder& folder, const std::string& name) {
    int computeWord = 8, fileWord = 8;
    const std::string path = folder.file(name);
    const int file = ex_create(path.c_str(), EX_CLOBBER, &computeWord, &fileWord);
    int failures = file < 0;
    failures += ex_put_init(file, "a box", 3, kNodes, 3, 2, 0, 0) != 0;
    const auto x = nodeValues([](const Vec3d& p) { return p.x; });
    const auto y = nodeValues([](const Vec3d& p) { return p.y; });
    const auto z = nodeValues([](const Vec3d& p) { return p.z; });
    failures += ex_put_coord(file, x.data(), y.data(), z.data()) != 0;
    failures += ex_put_block(file, EX_ELEM_BLOCK, 7, "HEX8", 1, 8, 0, 0, 0) != 0;
    failures += ex_put_block(file, EX_ELEM_BLOCK, 9, "WEDGE6", 2, 6, 0, 0, 0) != 0;
    std::vector<int> hexahedron, wedges;
    for (const int i : kHexahedron) hexahedron.push_back(i + 1);
    for (const auto& wedge : kWedges)
        for (const int i : wedge) wedges.push_back(i + 1);
    failures += ex_put_conn(file, EX_ELEM_BLOCK, 7, hexahedron.data(), nullptr, nullptr) != 0;
    failures += ex_put_conn(file, EX_ELEM_BLOCK, 9, wedges.data(), nullptr, nullptr) != 0;
    failures += ex_put_variable_param(file, EX_NODAL, 4) != 0;
    const std::array<const char*, 4> names{"temp", "vel_x", "vel_y", "vel_z"};
    for (int i = 0; i < 4; ++i)
        failures += ex_put_variable_name(file, EX_NODAL, i + 1, names[std::size_t(i)]) != 0;
    failures += ex_put_variable_param(file, EX_ELEM_BLOCK, 1) != 0;
    failures += ex_put_variable_name(file, EX_ELEM_BLOCK, 1, "material") != 0;
    for (int step = 0; step < 2; ++step) {
        const double time = 0.5 * step;
        failures += ex_put_time(file, step + 1, &time) != 0;
        const auto scalar = nodeValues([step](const Vec3d& p) { return scalarAt(p, step); });
        failures += ex_put_var(file, step + 1, EX_NODAL, 1, 1, kNodes, scalar.data()) != 0;
        for (int axis = 0; axis < 3; ++axis) {
            const auto component = nodeValues([axis](const Vec3d& p) { return vectorAt(p)[axis]; });
            failures += ex_put_var(file, step + 1, EX_NODAL, axis + 2, 1, kNodes, component.data()) != 0;
        }
        failures += ex_put_var(file, step + 1, EX_ELEM_BLOCK, 1, 7, 1, kCellValues.data()) != 0;
        failures += ex_put_var(file, step + 1, EX_ELEM_BLOCK, 1, 9, 2, kCellValues.data() + 1) != 0;
    }
    failures += ex_close(file) != 0;
    EXPECT_EQ(failures, 0);
    return path;
}

TEST(SolverFormats, Exodus) {
    const TemporaryFolder folder;
    const std::string path = writeExodus(folder, "box.ex2");
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
    const std::string path = writeExodus(folder, "box.ex2");
    const auto size = std::filesystem::file_size(path);
    std::filesystem::resize_file(path, size - 8);  // the last value of the last step
    EXPECT_PRED2(holds, refusal(path), "cut off: its variables take " + std::to_string(size));
    std::filesystem::resize_file(path, 100);
    EXPECT_PRED2(holds, refusal(path), "box.ex2: damaged");
}

TEST(SolverFormats, ExodusRefusesNodesThatAreNotThere) {
    const TemporaryFolder folder;
    for (const std::int64_t node : {0, 13, 1 << 30}) {
        const std::string path = writeExodus(folder, "box.ex2");
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

// CGNS

void check(int cgnsStatus) {
    if (cgnsStatus != 0) throw std::runtime_error(cg_get_error());
}

void writeCgnsNodes(int file, int base, int zone) {
    const std::array<const char*, 3> axes{"CoordinateX", "CoordinateY", "CoordinateZ"};
    int written = 0, solution = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const auto values = nodeValues([axis](const Vec3d& p) { return p[axis]; });
        check(cg_coord_write(file, base, zone, CGNS_ENUMV(RealDouble), axes[std::size_t(axis)], values.data(),
                             &written));
    }
    check(cg_sol_write(file, base, zone, "Nodes", CGNS_ENUMV(Vertex), &solution));
    const auto write = [&](const char* name, const std::vector<double>& values) {
        check(cg_field_write(file, base, zone, solution, CGNS_ENUMV(RealDouble), name, values.data(),
                             &written));
    };
    write("Temperature", nodeValues([](const Vec3d& p) { return scalarAt(p, 0); }));
    write("VelocityX", nodeValues([](const Vec3d& p) { return vectorAt(p).x; }));
    write("VelocityY", nodeValues([](const Vec3d& p) { return vectorAt(p).y; }));
    write("VelocityZ", nodeValues([](const Vec3d& p) { return vectorAt(p).z; }));
}

void writeCgnsCells(int file, int base, int zone, const std::vector<double>& values) {
    int solution = 0, written = 0;
    check(cg_sol_write(file, base, zone, "Cells", CGNS_ENUMV(CellCenter), &solution));
    check(cg_field_write(file, base, zone, solution, CGNS_ENUMV(RealDouble), "Material", values.data(),
                         &written));
}

struct CgnsFile {
    CgnsFile(const std::string& where, int kind) : path(where) {
        check(cg_set_file_type(kind));
        check(cg_open(path.c_str(), CG_MODE_WRITE, &file));
        check(cg_base_write(file, "Base", 3, 3, &base));
    }
    std::string path;
    int file = 0, base = 0;
};

TEST(SolverFormats, CgnsUnstructured) {
    const TemporaryFolder folder;
    for (const int kind : {CG_FILE_ADF, CG_FILE_HDF5}) {
        CgnsFile out(folder.file(kind == CG_FILE_ADF ? "adf.cgns" : "hdf5.cgns"), kind);
        const auto& [path, file, base] = out;
        int zone = 0, section = 0;
        const std::array<cgsize_t, 3> size{kNodes, 3, 0};
        check(cg_zone_write(file, base, "Zone", size.data(), CGNS_ENUMV(Unstructured), &zone));
        std::vector<cgsize_t> hexahedron, wedges;
        for (const int i : kHexahedron) hexahedron.push_back(i + 1);
        for (const auto& wedge : kWedges)
            for (const int i : wedge) wedges.push_back(i + 1);
        check(cg_section_write(file, base, zone, "Hexahedra", CGNS_ENUMV(HEXA_8), 1, 1, 0, hexahedron.data(),
                               &section));
        check(cg_section_write(file, base, zone, "Wedges", CGNS_ENUMV(PENTA_6), 2, 3, 0, wedges.data(),
                               &section));
        writeCgnsNodes(file, base, zone);
        writeCgnsCells(file, base, zone, {kCellValues.begin(), kCellValues.end()});
        check(cg_close(file));

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
    CgnsFile out(folder.file("box.cgns"), CG_FILE_HDF5);
    const auto& [path, file, base] = out;
    int zone = 0;
    const std::array<cgsize_t, 9> size{3, 2, 2, 2, 1, 1, 0, 0, 0};
    check(cg_zone_write(file, base, "Zone", size.data(), CGNS_ENUMV(Structured), &zone));
    writeCgnsNodes(file, base, zone);
    writeCgnsCells(file, base, zone, {10, 20});
    check(cg_close(file));

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
        check(cg_zone_write(file, base, name, size.data(), CGNS_ENUMV(Structured), &zone));
        writeCgnsNodes(file, base, zone);
        if (*name == 'A') continue;
        writeCgnsCells(file, base, zone, {10, 20});
        for (const char* field : {"Pressure", "ForceX", "ForceY", "ForceZ"})
            check(cg_field_write(file, base, zone, 1, CGNS_ENUMV(RealDouble), field,
                                 nodeValues([](const Vec3d& p) { return p.x; }).data(), &written));
    }
    check(cg_close(file));

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
    CgnsFile out(folder.file("polyhedron.cgns"), CG_FILE_HDF5);
    const auto& [path, file, base] = out;
    int zone = 0, section = 0;
    const std::array<cgsize_t, 3> size{kNodes, 1, 0};
    check(cg_zone_write(file, base, "Zone", size.data(), CGNS_ENUMV(Unstructured), &zone));
    writeCgnsNodes(file, base, zone);
    const std::array<cgsize_t, 24> nodes{1, 4,  5,  2, 7, 8, 11, 10, 1, 2, 8,  7,
                                         4, 10, 11, 5, 1, 7, 10, 4,  2, 5, 11, 8};
    const std::array<cgsize_t, 7> ends{0, 4, 8, 12, 16, 20, 24};
    check(cg_poly_section_write(file, base, zone, "Faces", CGNS_ENUMV(NGON_n), 1, 6, 0, nodes.data(),
                                ends.data(), &section));
    const std::array<cgsize_t, 6> faces{1, 2, 3, 4, 5, 6};
    const std::array<cgsize_t, 2> cellEnds{0, 6};
    check(cg_poly_section_write(file, base, zone, "Cells", CGNS_ENUMV(NFACE_n), 7, 7, 0, faces.data(),
                                cellEnds.data(), &section));
    check(cg_close(file));

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
    check(cg_zone_write(file, base, "Blade", size.data(), CGNS_ENUMV(Structured), &zone));
    writeCgnsNodes(file, base, zone);
    check(cg_sol_write(file, base, zone, "More", CGNS_ENUMV(Vertex), &solution));
    check(cg_field_write(file, base, zone, solution, CGNS_ENUMV(RealDouble), "Pressure",
                         nodeValues([](const Vec3d& p) { return p.x; }).data(), &written));
    check(cg_close(file));
    const MeshFile mesh = read(path);
    ASSERT_EQ(mesh.statistics.warnings.size(), 1u);
    EXPECT_PRED2(holds, mesh.statistics.warnings[0], "Zone 'Blade' has several solutions");
}

// EnSight Gold in text, two steps of the variables.

std::string lines(const std::vector<double>& values) {
    std::string text;
    for (const double v : values) text += fmt::format("{:12.5e}\n", v);
    return text;
}

template <typename Indices>
std::string indexLine(const Indices& indices) {
    std::string text;
    for (const int i : indices) text += fmt::format("{:10}", i + 1);
    return text + "\n";
}

std::string writeEnSight(const TemporaryFolder& folder) {
    const std::string part = "part\n         1\n";
    std::string geometry = "a box\nof three cells\nnode id assign\nelement id assign\n" + part +
                           "fluid\ncoordinates\n        12\n";
    for (int axis = 0; axis < 3; ++axis)
        geometry += lines(nodeValues([axis](const Vec3d& p) { return p[axis]; }));
    geometry += "hexa8\n         1\n" + indexLine(kHexahedron) + "penta6\n         2\n" +
                indexLine(kWedges[0]) + indexLine(kWedges[1]);
    folder.write("box.geo", geometry);
    std::string vector = "velocity\n" + part + "coordinates\n";
    for (int axis = 0; axis < 3; ++axis)
        vector += lines(nodeValues([axis](const Vec3d& p) { return vectorAt(p)[axis]; }));
    folder.write("box.vel", vector);
    for (int step = 0; step < 2; ++step) {
        const std::string number = fmt::format("{:04}", step);
        folder.write("box." + number + ".temp",
                     "temperature\n" + part + "coordinates\n" +
                         lines(nodeValues([step](const Vec3d& p) { return scalarAt(p, step); })));
        const double factor = step + 1;
        folder.write("box." + number + ".mat", "material\n" + part + "hexa8\n" +
                                                   lines({factor * kCellValues[0]}) + "penta6\n" +
                                                   lines({factor * kCellValues[1], factor * kCellValues[2]}));
    }
    return folder.write("box.case",
                        "FORMAT\ntype: ensight gold\n\nGEOMETRY\nmodel: box.geo\n\n"
                        "VARIABLE\nscalar per node: 1 temp box.****.temp\n"
                        "vector per node: vel box.vel\n"
                        "scalar per element: 1 material box.****.mat\n\n"
                        "TIME\ntime set: 1\nnumber of steps: 2\nfilename start number: 0\n"
                        "filename increment: 1\ntime values: 0.0 0.5\n");
}

TEST(SolverFormats, EnSightGold) {
    const TemporaryFolder folder;
    const std::string path = writeEnSight(folder);
    for (const int step : {-1, 0, 1}) {
        const MeshFile file = read(path, step);
        EXPECT_EQ(file.statistics.format, "EnSight");
        expectTheBox(file);
        const int shown = step < 0 ? 1 : step;
        expectScalar(file, "temp", shown);
        expectVector(file, "vel");
        expectCellValues(file, "material", shown + 1);
        EXPECT_EQ(file.mesh.fields.size(), 3u);
    }
}

TEST(SolverFormats, EnSightFilesThatLookCutOff) {
    const TemporaryFolder folder;
    const std::string path = writeEnSight(folder);
    EXPECT_TRUE(readMesh(path, {}, {}).statistics.warnings.empty());
    for (const char* name : {"box.geo", "box.vel"}) {
        writeEnSight(folder);
        std::filesystem::resize_file(folder.file(name), std::filesystem::file_size(folder.file(name)) - 3);
        const std::vector<std::string> warnings = readMesh(path, {}, {}).statistics.warnings;
        ASSERT_EQ(warnings.size(), 1u);
        EXPECT_PRED2(holds, warnings[0], std::string(name) + " may be cut off");
    }
}

// OpenFOAM: the two steps have a cell field and a point field each.

std::string foamHead(const std::string& kind, const std::string& object) {
    return "FoamFile\n{\n    version 2.0;\n    format ascii;\n    class " + kind + ";\n    object " + object +
           ";\n}\n\n";
}

std::string foamList(const std::vector<std::string>& entries) {
    std::string text = fmt::format("{}\n(\n", entries.size());
    for (const std::string& entry : entries) text += entry + "\n";
    return text + ")\n";
}

/// @param region empty, or the region's name and a slash.
void writeFoamMesh(const TemporaryFolder& folder, const std::string& region) {
    std::vector<std::string> points, faces, owners;
    for (int i = 0; i < kNodes; ++i) {
        const Vec3d p = node(i);
        points.push_back(fmt::format("({} {} {})", p.x, p.y, p.z));
    }
    // Every face looks away from its owner; those between two cells come first.
    const std::vector<std::pair<std::string, int>> ordered{
        {"4(1 4 10 7)", 0}, {"4(2 8 10 4)", 1},  {"4(0 6 9 3)", 0}, {"4(0 1 7 6)", 0}, {"4(3 9 10 4)", 0},
        {"4(0 3 4 1)", 0},  {"4(6 7 10 9)", 0},  {"4(1 2 8 7)", 1}, {"3(1 4 2)", 1},   {"3(7 8 10)", 1},
        {"4(2 5 11 8)", 2}, {"4(4 10 11 5)", 2}, {"3(2 4 5)", 2},   {"3(8 11 10)", 2}};
    for (const auto& [face, owner] : ordered) {
        faces.push_back(face);
        owners.push_back(std::to_string(owner));
    }
    const std::string mesh = "constant/" + region + "polyMesh/";
    std::filesystem::create_directories(folder.file(mesh));
    folder.write(mesh + "points", foamHead("vectorField", "points") + foamList(points));
    folder.write(mesh + "faces", foamHead("faceList", "faces") + foamList(faces));
    folder.write(mesh + "owner", foamHead("labelList", "owner") + foamList(owners));
    folder.write(mesh + "neighbour", foamHead("labelList", "neighbour") + foamList({"1", "2"}));
    folder.write(mesh + "boundary", foamHead("polyBoundaryMesh", "boundary") +
                                        "1\n(\nwalls\n{\ntype wall;\nnFaces 12;\nstartFace 2;\n}\n)\n");
}

void writeFoamFields(const TemporaryFolder& folder, const std::string& region) {
    std::filesystem::create_directories(folder.file("system"));
    folder.write("system/controlDict", foamHead("dictionary", "controlDict") +
                                           "startFrom startTime;\nstartTime 0;\nstopAt endTime;\nendTime 1;\n"
                                           "deltaT 0.5;\nwriteControl timeStep;\nwriteInterval 1;\n");
    for (int step = 0; step < 2; ++step) {
        const std::string time = (step == 0 ? "0.5/" : "1/") + region;
        std::filesystem::create_directories(folder.file(time));
        std::vector<std::string> cells, nodes;
        for (const double value : kCellValues) cells.push_back(fmt::format("{}", (step + 1) * value));
        for (int i = 0; i < kNodes; ++i) nodes.push_back(fmt::format("{}", scalarAt(node(i), step)));
        folder.write(time + "p", foamHead("volScalarField", "p") +
                                     "dimensions [0 2 -2 0 0 0 0];\ninternalField nonuniform List<scalar>\n" +
                                     foamList(cells) + ";\nboundaryField { walls { type zeroGradient; } }\n");
        folder.write(time + "T", foamHead("pointScalarField", "T") +
                                     "dimensions [0 0 0 1 0 0 0];\ninternalField nonuniform List<scalar>\n" +
                                     foamList(nodes) + ";\nboundaryField { walls { type calculated; } }\n");
        folder.write(time + "U", foamHead("volVectorField", "U") +
                                     "dimensions [0 1 -1 0 0 0 0];\ninternalField uniform (1 2 3);\n"
                                     "boundaryField { walls { type zeroGradient; } }\n");
    }
}

TEST(SolverFormats, OpenFoam) {
    const TemporaryFolder folder;
    writeFoamMesh(folder, "");
    writeFoamFields(folder, "");
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

TEST(SolverFormats, OpenFoamRegions) {
    const TemporaryFolder folder;
    for (const char* region : {"fluid/", "solid/"}) {
        writeFoamMesh(folder, region);
        writeFoamFields(folder, region);
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
    writeFoamMesh(folder, "");
    writeFoamFields(folder, "");
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
