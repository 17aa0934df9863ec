#include "mesh_files/box_files.h"

#include <fmt/format.h>
#include <vtk_exodusII.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <stdexcept>

#include "vtu_text.h"

namespace tessera::test {

namespace {

void writeFile(const std::string& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
}

}  // namespace

Vec3d node(int i) {
    return {double(i % 3), double(i / 3 % 2), double(i / 6)};
}

double scalarAt(const Vec3d& p, int step) {
    return (1 + p.x + 2 * p.y + 4 * p.z) * (step + 1);
}

Vec3d vectorAt(const Vec3d& p) {
    return {p.x, -p.y, 3 * p.z};
}

std::vector<double> nodeValues(const std::function<double(const Vec3d&)>& value) {
    std::vector<double> values;
    for (int i = 0; i < kNodes; ++i) values.push_back(value(node(i)));
    return values;
}

void writeExodus(const std::string& path, int mode) {
    int computeWord = 8, fileWord = 8;
    const int file = ex_create(path.c_str(), mode, &computeWord, &fileWord);
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
    if (failures > 0) throw std::runtime_error("writing " + path);
}

void checkCgns(int status) {
    if (status != 0) throw std::runtime_error(cg_get_error());
}

void writeCgnsNodes(int file, int base, int zone) {
    const std::array<const char*, 3> axes{"CoordinateX", "CoordinateY", "CoordinateZ"};
    int written = 0, solution = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const auto values = nodeValues([axis](const Vec3d& p) { return p[axis]; });
        checkCgns(cg_coord_write(file, base, zone, CGNS_ENUMV(RealDouble), axes[std::size_t(axis)],
                                 values.data(), &written));
    }
    checkCgns(cg_sol_write(file, base, zone, "Nodes", CGNS_ENUMV(Vertex), &solution));
    const auto write = [&](const char* name, const std::vector<double>& values) {
        checkCgns(cg_field_write(file, base, zone, solution, CGNS_ENUMV(RealDouble), name, values.data(),
                                 &written));
    };
    write("Temperature", nodeValues([](const Vec3d& p) { return scalarAt(p, 0); }));
    write("VelocityX", nodeValues([](const Vec3d& p) { return vectorAt(p).x; }));
    write("VelocityY", nodeValues([](const Vec3d& p) { return vectorAt(p).y; }));
    write("VelocityZ", nodeValues([](const Vec3d& p) { return vectorAt(p).z; }));
}

void writeCgnsCells(int file, int base, int zone, const std::vector<double>& values) {
    int solution = 0, written = 0;
    checkCgns(cg_sol_write(file, base, zone, "Cells", CGNS_ENUMV(CellCenter), &solution));
    checkCgns(cg_field_write(file, base, zone, solution, CGNS_ENUMV(RealDouble), "Material", values.data(),
                             &written));
}

CgnsFile::CgnsFile(const std::string& where, int kind) : path(where) {
    checkCgns(cg_set_file_type(kind));
    checkCgns(cg_open(path.c_str(), CG_MODE_WRITE, &file));
    checkCgns(cg_base_write(file, "Base", 3, 3, &base));
}

void writeCgnsUnstructured(const std::string& path, int kind) {
    const CgnsFile out(path, kind);
    int zone = 0, section = 0;
    const std::array<cgsize_t, 3> size{kNodes, 3, 0};
    checkCgns(cg_zone_write(out.file, out.base, "Zone", size.data(), CGNS_ENUMV(Unstructured), &zone));
    std::vector<cgsize_t> hexahedron, wedges;
    for (const int i : kHexahedron) hexahedron.push_back(i + 1);
    for (const auto& wedge : kWedges)
        for (const int i : wedge) wedges.push_back(i + 1);
    checkCgns(cg_section_write(out.file, out.base, zone, "Hexahedra", CGNS_ENUMV(HEXA_8), 1, 1, 0,
                               hexahedron.data(), &section));
    checkCgns(cg_section_write(out.file, out.base, zone, "Wedges", CGNS_ENUMV(PENTA_6), 2, 3, 0,
                               wedges.data(), &section));
    writeCgnsNodes(out.file, out.base, zone);
    writeCgnsCells(out.file, out.base, zone, {kCellValues.begin(), kCellValues.end()});
    checkCgns(cg_close(out.file));
}

void writeCgnsStructured(const std::string& path, int kind) {
    const CgnsFile out(path, kind);
    int zone = 0;
    const std::array<cgsize_t, 9> size{3, 2, 2, 2, 1, 1, 0, 0, 0};
    checkCgns(cg_zone_write(out.file, out.base, "Zone", size.data(), CGNS_ENUMV(Structured), &zone));
    writeCgnsNodes(out.file, out.base, zone);
    writeCgnsCells(out.file, out.base, zone, {10, 20});
    checkCgns(cg_close(out.file));
}

void writeCgnsPolyhedron(const std::string& path, int kind) {
    const CgnsFile out(path, kind);
    int zone = 0, section = 0;
    const std::array<cgsize_t, 3> size{kNodes, 1, 0};
    checkCgns(cg_zone_write(out.file, out.base, "Zone", size.data(), CGNS_ENUMV(Unstructured), &zone));
    writeCgnsNodes(out.file, out.base, zone);
    const std::array<cgsize_t, 24> nodes{1, 4,  5,  2, 7, 8, 11, 10, 1, 2, 8,  7,
                                         4, 10, 11, 5, 1, 7, 10, 4,  2, 5, 11, 8};
    const std::array<cgsize_t, 7> ends{0, 4, 8, 12, 16, 20, 24};
    checkCgns(cg_poly_section_write(out.file, out.base, zone, "Faces", CGNS_ENUMV(NGON_n), 1, 6, 0,
                                    nodes.data(), ends.data(), &section));
    const std::array<cgsize_t, 6> faces{1, 2, 3, 4, 5, 6};
    const std::array<cgsize_t, 2> cellEnds{0, 6};
    checkCgns(cg_poly_section_write(out.file, out.base, zone, "Cells", CGNS_ENUMV(NFACE_n), 7, 7, 0,
                                    faces.data(), cellEnds.data(), &section));
    checkCgns(cg_close(out.file));
}

// EnSight

namespace {

/// The text or the bytes of one file.
class EnSightFile {
  public:
    EnSightFile(EnSightVersion version, Encoding encoding)
        : isGold_(version == EnSightVersion::gold), isText_(encoding == Encoding::text) {}

    void line(const std::string& text) { bytes_ += isText_ ? text + "\n" : fmt::format("{:<80}", text); }
    void number(int value) { numbers(std::array{value}); }
    void numbers(std::span<const int> values) {
        if (!isText_) {
            bytes_ += bytesOf<std::int32_t>(values);
            return;
        }
        for (const int value : values) bytes_ += fmt::format("{:{}}", value, isGold_ ? 10 : 8);
        bytes_ += "\n";
    }
    void corners(std::span<const int> cell) {
        std::vector<int> fromOne;
        for (const int corner : cell) fromOne.push_back(corner + 1);
        numbers(fromOne);
    }
    void values(std::span<const double> list, std::size_t perLine) {
        if (!isText_) {
            bytes_ += bytesOf<float>(list);
            return;
        }
        for (std::size_t i = 0; i < list.size(); ++i)
            bytes_ += fmt::format("{:12.5e}{}", list[i],
                                  (i + 1) % perLine == 0 || i + 1 == list.size() ? "\n" : "");
    }
    void values(std::span<const double> list) { values(list, isGold_ ? 1 : 6); }
    /// Of every node; EnSight Gold has one component after the other.
    void vectors(const std::function<Vec3d(const Vec3d&)>& value, std::size_t perLine) {
        std::vector<double> list;
        for (int i = 0; i < 3 * kNodes; ++i)
            list.push_back(isGold_ ? value(node(i % kNodes))[i / kNodes] : value(node(i / 3))[i % 3]);
        values(list, isGold_ ? 1 : perLine);
    }
    void part() {
        line(isGold_ ? "part" : "part       1");
        if (isGold_) number(1);
    }
    bool isGold() const { return isGold_; }
    bool isText() const { return isText_; }
    const std::string& bytes() const { return bytes_; }

  private:
    bool isGold_, isText_;
    std::string bytes_;
};

std::string enSightGeometry(EnSightFile file) {
    const auto coordinates = [&] {
        file.line("coordinates");
        file.number(kNodes);
        file.vectors([](const Vec3d& p) { return p; }, 3);
    };
    if (!file.isText()) file.line("C Binary");
    for (const char* text : {"a box", "of three cells", "node id assign", "element id assign"})
        file.line(text);
    if (!file.isGold()) coordinates();
    file.part();
    file.line("fluid");
    if (file.isGold()) coordinates();
    file.line("hexa8");
    file.number(1);
    file.corners(kHexahedron);
    file.line("penta6");
    file.number(2);
    for (const auto& wedge : kWedges) file.corners(wedge);
    return file.bytes();
}

void beginNodes(EnSightFile& file, const char* name) {
    file.line(name);
    if (!file.isGold()) return;
    file.part();
    file.line("coordinates");
}

}  // namespace

std::string writeEnSight(const std::string& folder, EnSightVersion version, Encoding encoding) {
    const EnSightFile empty(version, encoding);
    const bool hasTemperature = version == EnSightVersion::gold || encoding == Encoding::text;
    writeFile(folder + "/box.geo", enSightGeometry(empty));
    EnSightFile velocity = empty;
    beginNodes(velocity, "velocity");
    velocity.vectors(vectorAt, 6);
    writeFile(folder + "/box.vel", velocity.bytes());
    for (int step = 0; step < 2; ++step) {
        const std::string number = fmt::format("/box.{:04}", step);
        EnSightFile temperature = empty, material = empty;
        beginNodes(temperature, "temperature");
        temperature.values(nodeValues([step](const Vec3d& p) { return scalarAt(p, step); }));
        if (hasTemperature) writeFile(folder + number + ".temp", temperature.bytes());
        const double factor = step + 1;
        material.line("material");
        material.part();
        material.line("hexa8");
        material.values(std::array{factor * kCellValues[0]});
        material.line("penta6");
        material.values(std::array{factor * kCellValues[1], factor * kCellValues[2]});
        writeFile(folder + number + ".mat", material.bytes());
    }
    writeFile(folder + "/box.case",
              fmt::format("FORMAT\ntype: ensight{}\n\nGEOMETRY\nmodel: box.geo\n\n"
                          "VARIABLE\n{}vector per node: vel box.vel\n"
                          "scalar per element: 1 material box.****.mat\n\n"
                          "TIME\ntime set: 1\nnumber of steps: 2\nfilename start number: 0\n"
                          "filename increment: 1\ntime values: 0.0 0.5\n",
                          empty.isGold() ? " gold" : "",
                          hasTemperature ? "scalar per node: 1 temp box.****.temp\n" : ""));
    return folder + "/box.case";
}

// OpenFOAM

namespace {

std::string foamHead(const std::string& kind, const std::string& object, Encoding encoding) {
    const char* format =
        encoding == Encoding::text ? "format ascii" : "format binary;\n    arch \"LSB;label=32;scalar=64\"";
    return fmt::format("FoamFile\n{{\n    version 2.0;\n    {};\n    class {};\n    object {};\n}}\n\n",
                       format, kind, object);
}

template <typename Stored, typename Values>
std::string foamList(const Values& values, Encoding encoding) {
    if (encoding == Encoding::binary) return fmt::format("{}({})\n", values.size(), bytesOf<Stored>(values));
    return fmt::format("{}\n(\n{}\n)\n", values.size(), fmt::join(values, "\n"));
}

std::string foamPoints(Encoding encoding) {
    std::string text = fmt::format("{}\n(", kNodes);
    for (int i = 0; i < kNodes; ++i) {
        const Vec3d p = node(i);
        text += encoding == Encoding::text ? fmt::format("\n({} {} {})", p.x, p.y, p.z)
                                           : bytesOf<double>(std::array{p.x, p.y, p.z});
    }
    return text + ")\n";
}

std::string foamFaces(const std::vector<std::vector<int>>& faces, Encoding encoding) {
    std::vector<int> begins{0}, corners;
    std::string text = fmt::format("{}\n(\n", faces.size());
    for (const std::vector<int>& face : faces) {
        text += fmt::format("{}({})\n", face.size(), fmt::join(face, " "));
        corners.insert(corners.end(), face.begin(), face.end());
        begins.push_back(int(corners.size()));
    }
    if (encoding == Encoding::text) return text + ")\n";
    return foamList<std::int32_t>(begins, encoding) + foamList<std::int32_t>(corners, encoding);
}

}  // namespace

void writeFoamMesh(const std::string& folder, const std::string& region, Encoding encoding) {
    // Every face looks away from its owner; those between two cells come first.
    const std::vector<std::vector<int>> faces{{1, 4, 10, 7}, {2, 8, 10, 4}, {0, 6, 9, 3},  {0, 1, 7, 6},
                                              {3, 9, 10, 4}, {0, 3, 4, 1},  {6, 7, 10, 9}, {1, 2, 8, 7},
                                              {1, 4, 2},     {7, 8, 10},    {2, 5, 11, 8}, {4, 10, 11, 5},
                                              {2, 4, 5},     {8, 11, 10}};
    const std::vector<int> owners{0, 1, 0, 0, 0, 0, 0, 1, 1, 1, 2, 2, 2, 2}, neighbours{1, 2};
    const std::string mesh = folder + "/constant/" + region + "polyMesh/";
    std::filesystem::create_directories(mesh);
    writeFile(mesh + "points", foamHead("vectorField", "points", encoding) + foamPoints(encoding));
    writeFile(mesh + "faces",
              foamHead(encoding == Encoding::text ? "faceList" : "faceCompactList", "faces", encoding) +
                  foamFaces(faces, encoding));
    writeFile(mesh + "owner",
              foamHead("labelList", "owner", encoding) + foamList<std::int32_t>(owners, encoding));
    writeFile(mesh + "neighbour",
              foamHead("labelList", "neighbour", encoding) + foamList<std::int32_t>(neighbours, encoding));
    writeFile(mesh + "boundary", foamHead("polyBoundaryMesh", "boundary", Encoding::text) +
                                     "1\n(\nwalls\n{\ntype wall;\nnFaces 12;\nstartFace 2;\n}\n)\n");
}

void writeFoamFields(const std::string& folder, const std::string& region, Encoding encoding) {
    std::filesystem::create_directories(folder + "/system");
    writeFile(folder + "/system/controlDict",
              foamHead("dictionary", "controlDict", Encoding::text) +
                  "startFrom startTime;\nstartTime 0;\nstopAt endTime;\nendTime 1;\n"
                  "deltaT 0.5;\nwriteControl timeStep;\nwriteInterval 1;\n");
    for (int step = 0; step < 2; ++step) {
        const std::string time = folder + (step == 0 ? "/0.5/" : "/1/") + region;
        std::filesystem::create_directories(time);
        std::vector<double> cells;
        for (const double value : kCellValues) cells.push_back((step + 1) * value);
        const auto nodes = nodeValues([step](const Vec3d& p) { return scalarAt(p, step); });
        writeFile(time + "p", foamHead("volScalarField", "p", encoding) +
                                  "dimensions [0 2 -2 0 0 0 0];\ninternalField nonuniform List<scalar>\n" +
                                  foamList<double>(cells, encoding) +
                                  ";\nboundaryField { walls { type zeroGradient; } }\n");
        writeFile(time + "T", foamHead("pointScalarField", "T", encoding) +
                                  "dimensions [0 0 0 1 0 0 0];\ninternalField nonuniform List<scalar>\n" +
                                  foamList<double>(nodes, encoding) +
                                  ";\nboundaryField { walls { type calculated; } }\n");
        writeFile(time + "U", foamHead("volVectorField", "U", encoding) +
                                  "dimensions [0 1 -1 0 0 0 0];\ninternalField uniform (1 2 3);\n"
                                  "boundaryField { walls { type zeroGradient; } }\n");
    }
}

}  // namespace tessera::test
