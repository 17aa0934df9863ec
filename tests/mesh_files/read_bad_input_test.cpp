#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "base/sanitizers.h"
#include "mesh_files/read_mesh.h"
#include "mesh_test_tools.h"
#include "reference/random.h"
#include "tessera/error.h"
#include "vtu_text.h"

#ifdef TESSERA_ADDRESS_SANITIZER
// VTK 9.1's legacy reader loses its cell arrays when a file ends early. The libraries stand for it, as stacks
// end there.
extern "C" const char* __lsan_default_suppressions() {
    return "leak:vtkCellArray::New\nleak:libvtkCommonCore\nleak:libvtkCommonDataModel\n";
}
#endif

namespace tessera {
namespace {

using test::TemporaryFolder;
using test::VtuText;

/// Reads a file that must be refused; the message holds the path and all the given words, in one line, and
/// nothing was printed.
void expectRefused(const std::string& path, const std::vector<std::string>& words,
                   const ReadOptions& options = {}) {
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    std::string message = "(it was read)";
    bool isInputError = false;
    try {
        readMesh(path, options, {});
    } catch (const InputError& error) {
        isInputError = true;
        message = error.what();
    } catch (const std::exception& error) {
        message = error.what();
    }
    EXPECT_EQ(testing::internal::GetCapturedStdout() + testing::internal::GetCapturedStderr(), "");
    EXPECT_TRUE(isInputError) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    EXPECT_NE(message.find(std::filesystem::path(path).stem().string()), std::string::npos) << message;
    for (const std::string& word : words)
        EXPECT_NE(message.find(word), std::string::npos) << "no '" << word << "' in: " << message;
}

std::string contentOf(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

VtuText oneTet() {
    VtuText vtu;
    vtu.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    vtu.cells = {{10, {0, 1, 2, 3}}};
    vtu.pointArrays.push_back({"f", "Float64", 1, "1 2 3 4"});
    return vtu;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
}

TEST(BadFile, MissingEmptyOrNoFile) {
    const TemporaryFolder folder;
    for (const char* name : {"a.vtu", "a.vtk", "a.node", "a.e", "a.foam", "a.case", "a.cgns", "a"})
        expectRefused(folder.file(name), {"no such file"});
    for (const char* name : {"b.vtu", "b.vtk", "b.node", "b.e", "b.case", "b.cgns", "b"})
        expectRefused(folder.write(name, ""), {"empty"});
    std::filesystem::create_directory(folder.file("c.vtu"));
    expectRefused(folder.file("c.vtu"), {"directory"});
    expectRefused("/dev/null", {"regular"});
}

TEST(BadFile, UnknownFormatsAreRefusedWithTheKnownOnes) {
    const TemporaryFolder folder;
    expectRefused(folder.write("a.stl", "solid x\n"), {"unknown format", ".vtu", ".node"});
    for (const char* name : {"g.vtu", "g.vtk", "g.vtm", "g.pvtu", "g.e", "g.cgns", "g.case", "g.vts"}) {
        expectRefused(folder.write(name, "Lorem ipsum dolor sit amet\n"), {});
        expectRefused(folder.write(name, std::string("\x00\xff\x01zzz", 6)), {});
    }
}

TEST(BadFile, PoisonedHeadsOfBinaryFormatsAreRefused) {
    const TemporaryFolder folder;
    expectRefused(folder.write("a.e", std::string("CDF\x01") + std::string(100, '\x7f')), {});
    expectRefused(folder.write("b.e", std::string("\x89HDF\r\n\x1a\n") + std::string(100, '\x7f')), {});
    expectRefused(folder.write("c.cgns", std::string("\x89HDF\r\n\x1a\n") + std::string(100, '\x7f')), {});
    expectRefused(folder.write("d.case", "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: gone.geo\n"), {});
    expectRefused(folder.write("e.foam", ""), {});
}

TEST(BadXml, EveryTruncationIsRefused) {
    const TemporaryFolder folder;
    const std::string ascii = oneTet().text();
    for (std::size_t length = 1; length < ascii.size() - 12; length += 7)
        expectRefused(folder.write("t.vtu", ascii.substr(0, length)), {});
    const std::string binary = contentOf(TESSERA_DATA_DIR "/disk_out_ref/disk_out_ref.vtu");
    for (int part = 1; part < 20; ++part)
        expectRefused(folder.write("b.vtu", binary.substr(0, binary.size() * std::size_t(part) / 20)), {});
    expectRefused(folder.write("c.vtu", binary.substr(0, binary.size() / 2)), {"cut off", "byte"});
    expectRefused(folder.write("d.vtu", ascii + "trailing"), {"byte", "trailing"});
}

TEST(BadXml, GarbageInsideIsRefused) {
    const TemporaryFolder folder;
    const std::string ascii = oneTet().text();
    expectRefused(folder.write("a.vtu", replaced(ascii, "<Points>", "<Points")), {});
    expectRefused(folder.write("b.vtu", replaced(ascii, "</Cells>", "")), {});
    expectRefused(folder.write("c.vtu", replaced(ascii, "type=\"UnstructuredGrid\"", "type=\"Marshmallow\"")),
                  {"Marshmallow"});
    expectRefused(folder.write("d.vtu", replaced(ascii, "type=\"UnstructuredGrid\"", "")), {"type"});
    expectRefused(folder.write("e.vtu", replaced(ascii, "type=\"UnstructuredGrid\"", "type=\"PolyData\"")),
                  {"PolyData"});
}

TEST(BadXml, CountsThatDoNotFitAreRefused) {
    const TemporaryFolder folder;
    const std::string ascii = oneTet().text();
    for (const char* count : {"-4", "4x", "1e3", "999999999999999999999", "1099511627776"})
        expectRefused(folder.write("p.vtu", replaced(ascii, "NumberOfPoints=\"4\"",
                                                     "NumberOfPoints=\"" + std::string(count) + "\"")),
                      {});
    expectRefused(
        folder.write("q.vtu", replaced(ascii, "NumberOfPoints=\"4\"", "NumberOfPoints=\"1000000000\"")),
        {"1000000000", "bytes"});
    expectRefused(folder.write("r.vtu", replaced(ascii, "NumberOfPoints=\"4\"", "NumberOfPoints=\"5\"")), {});
    expectRefused(folder.write("s.vtu", replaced(ascii, "NumberOfCells=\"1\"", "NumberOfCells=\"2\"")), {});
    expectRefused(folder.write("t.vtu", replaced(ascii, ">\n1 2 3 4\n", ">\n1 2 3\n")), {});
}

/// A file of one tetrahedron whose point field stands behind the markup, as `data`.
std::string withAppended(const std::string& data, const std::string& rootAttributes = "",
                         const std::string& offset = "0", const std::string& encoding = "raw") {
    VtuText vtu = oneTet();
    vtu.pointArrays.clear();
    std::string text = replaced(
        vtu.text(), "<PointData>",
        "<PointData><DataArray type=\"Float64\" Name=\"f\" format=\"appended\" offset=\"" + offset + "\"/>");
    text = replaced(text, "header_type=\"UInt64\"", rootAttributes + " header_type=\"UInt64\"");
    return replaced(text, "</VTKFile>",
                    "<AppendedData encoding=\"" + encoding + "\">_" + data + "</AppendedData></VTKFile>");
}

std::string bytesOf(std::initializer_list<std::uint64_t> words) {
    std::string bytes;
    for (const std::uint64_t word : words) bytes.append(reinterpret_cast<const char*>(&word), sizeof word);
    return bytes;
}

TEST(DeclaredSize, AppendedArraysMustFitTheFile) {
    const TemporaryFolder folder;
    const std::string values(32, '\0');
    EXPECT_EQ(
        readMesh(folder.write("good.vtu", withAppended(bytesOf({32}) + values)), {}, {}).mesh.fields.size(),
        1U);
    for (const std::uint64_t size : {std::uint64_t(33), std::uint64_t(1) << 40, ~std::uint64_t(0)})
        expectRefused(folder.write("a.vtu", withAppended(bytesOf({size}) + values)),
                      {"'f'", "declares " + std::to_string(size) + " bytes", "byte"});
    expectRefused(folder.write("b.vtu", withAppended(bytesOf({32}) + values, "", "41")),
                  {"offset", "'41'", "40"});
    expectRefused(folder.write("c.vtu", withAppended(bytesOf({32}) + values, "", "-1")), {"offset"});
    expectRefused(folder.write("d.vtu", withAppended(bytesOf({32}) + values, "", "36")),
                  {"'f'", "ends before"});
}

TEST(DeclaredSize, CompressedBlocksMustFitTheFile) {
    const TemporaryFolder folder;
    const std::string zlib = "compressor=\"vtkZLibDataCompressor\"", values(40, 'x');
    const auto refuse = [&](std::initializer_list<std::uint64_t> head,
                            const std::vector<std::string>& words) {
        expectRefused(folder.write("z.vtu", withAppended(bytesOf(head) + values, zlib)), words);
    };
    refuse({999999999999, 32768, 0, 40}, {"'f'", "999999999999 blocks"});
    refuse({~std::uint64_t(0), 32768, 0, 40}, {"'f'", "blocks"});
    refuse({1, std::uint64_t(1) << 50, 0, 40}, {"'f'", "1 blocks of 1125899906842624 bytes"});
    refuse({2, 1000, 5000, 40}, {"'f'", "blocks"});
    expectRefused(folder.write("s.vtu", withAppended(bytesOf({3}), zlib)), {"'f'", "ends before its sizes"});
    // base64: one block of 2^50 bytes.
    expectRefused(folder.write("t.vtu", withAppended("AQAAAAAAAAAAAAAAAAAEAAAAAAAAAAAAKAAAAAAAAAA=", zlib,
                                                     "0", "base64")),
                  {"'f'", "1 blocks of 1125899906842624 bytes"});
}

TEST(DeclaredSize, CountsBeyondTheFileAreRefused) {
    const TemporaryFolder folder;
    const std::string ascii = oneTet().text();
    expectRefused(
        folder.write("a.vtu", replaced(ascii, "NumberOfCells=\"1\"", "NumberOfCells=\"999999999999\"")),
        {"999999999999 cells", "bytes"});
    expectRefused(folder.write("b.vtu", replaced(ascii, "Name=\"f\" NumberOfComponents=\"1\"",
                                                 "Name=\"f\" NumberOfComponents=\"1000000000\"")),
                  {"'f'", "1000000000 components"});
}

TEST(DeclaredSize, ExtentsBeyondTheFileAreRefused) {
    const TemporaryFolder folder;
    const auto grid = [&](const std::string& whole, const std::string& piece, const std::string& type,
                          const std::string& inside) {
        return "<VTKFile type=\"" + type + "\" version=\"0.1\"><" + type + " WholeExtent=\"" + whole +
               "\"><Piece Extent=\"" + piece + "\">" + inside + "</Piece></" + type + "></VTKFile>";
    };
    const std::string points =
        "<Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 1 0 1 1 "
        "0 0 0 1 "
        "1 0 1 0 1 1 1 1 1</DataArray></Points>";
    const std::string eight = "0 1 0 1 0 1";
    EXPECT_EQ(readMesh(folder.write("good.vts", grid(eight, eight, "StructuredGrid", points)), {}, {})
                  .mesh.nodeCount(),
              8);
    const std::string large = "0 999 0 999 0 999";
    expectRefused(folder.write("a.vts", grid(large, large, "StructuredGrid", points)),
                  {"1000000000", "bytes"});
    expectRefused(folder.write("b.vts", grid(large, eight, "StructuredGrid", points)),
                  {"WholeExtent", "1000000000"});
    expectRefused(folder.write("c.vts", grid("0 99999 0 99999 0 99999", eight, "StructuredGrid", points)),
                  {"WholeExtent", "2147483647"});
    expectRefused(folder.write("d.vts", grid("0 9 0 9", eight, "StructuredGrid", points)), {"six"});
    expectRefused(folder.write("e.vts", grid("0 99999999999 0 9 0 9", eight, "StructuredGrid", points)),
                  {"six"});
    const std::string field =
        "<PointData><DataArray type=\"Float32\" Name=\"f\" format=\"ascii\">1 2</DataArray></PointData>";
    expectRefused(folder.write("f.vti", grid(large, large, "ImageData", field)),
                  {"'f'", "1000000000", "bytes"});
    expectRefused(folder.write("g.vtr", grid(large, large, "RectilinearGrid", field)), {"'f'", "1000000000"});
}

TEST(DeclaredSize, FilesThatNameEachOtherEnd) {
    const TemporaryFolder folder;
    std::string names;
    for (int i = 0; i < 200; ++i) names += "<DataSet index=\"" + std::to_string(i) + "\" file=\"a.vtm\"/>";
    expectRefused(
        folder.write("a.vtm",
                     "<VTKFile type=\"vtkMultiBlockDataSet\" version=\"1.0\"><vtkMultiBlockDataSet>" + names +
                         "</vtkMultiBlockDataSet></VTKFile>"),
        {"8 deep"});
    std::string tags;
    for (int i = 0; i < 300000; ++i) tags += "<Piece";
    expectRefused(folder.write("b.vtu", "<VTKFile type=\"UnstructuredGrid\">" + tags + "</VTKFile>"), {});
}

TEST(DeclaredSize, LegacyLinesMustFitTheFile) {
    const TemporaryFolder folder;
    const std::string head = "# vtk DataFile Version 3.0\nt\n";
    const auto refuse = [&](const std::string& rest, const std::string& word) {
        expectRefused(folder.write("l.vtk", head + rest), {word, "declares"});
    };
    const std::string cells = "0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n";
    refuse("ASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1000000000000 double\n" + cells, "POINTS 1000000000000");
    refuse("ASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 40 double\n" + cells, "POINTS 40");
    refuse("BINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 40 double\n" + cells, "POINTS 40");
    refuse("ASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n" + replaced(cells, "CELLS 1 5", "CELLS 1 60"),
           "CELLS 1 60");
    refuse("ASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 99999 99999 99999\nORIGIN 0 0 0\nSPACING 1 1 1\n",
           "DIMENSIONS 99999 99999");
    refuse("ASCII\nDATASET RECTILINEAR_GRID\nDIMENSIONS 2 2 2\nX_COORDINATES 99999999 float\n0 1\n",
           "X_COORDINATES 99999999");
}

TEST(DeclaredSize, LegacyWordsAreThoseOfVtksReader) {
    const TemporaryFolder folder;
    const std::string grid = "DATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n0 0 0 1 0 0 0 1 0 0 0 1\n";
    const std::string cells = "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n";
    const auto elements = [&](const std::string& text) {
        return readMesh(folder.write("l.vtk", "# vtk DataFile Version 3.0\n" + text), {}, {})
            .mesh.elementCount();
    };
    EXPECT_EQ(elements("POINTS 999999999 float\nASCII\n" + grid + cells), 1);
    EXPECT_EQ(elements("\n\n ascii\n" + grid + cells), 1);
    EXPECT_EQ(elements("t\nASCII\ndataset unstructured_grid\npoints\t4\tdouble\n0 0 0 1 0 0 0 1 0 0 0 1 "
                       "Cells 1\n5\n4 0 1 2 3\n\tcell_types 1\n10\n"),
              1);
    const auto refuse = [&](const std::string& text, const std::string& word) {
        expectRefused(folder.write("l.vtk", "# vtk DataFile Version 3.0\n" + text), {word, "declares"});
    };
    refuse("t\nASCII\n" + replaced(grid, "POINTS 4", "points\t\t4000000"), "points");
    refuse("t\nASCII\n" + replaced(grid, "POINTS 4", "Points\n4000000"), "Points");
    refuse("t\nASCII\n" + grid + "\t" + replaced(cells, "CELLS 1 5", "cells 1\t500"), "cells 1");
    refuse("t\nbinary\n" + replaced(grid, "POINTS 4", "POINTS +4000000"), "POINTS +4000000");
}

TEST(DeclaredSize, LegacyWordsAreFoundWhereverTheFileIsDivided) {
    const TemporaryFolder folder;
    const std::string head = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n";
    for (std::size_t at = (256 << 10) - 40; at < (256 << 10) + 3; ++at)
        expectRefused(
            folder.write("l.vtk", head + std::string(at - head.size(), ' ') + "POINTS 4000000 double\n"),
            {"POINTS 4000000", "byte " + std::to_string(at)});
}

TEST(BadXml, NodeIndicesOutOfRangeAreNamed) {
    const TemporaryFolder folder;
    VtuText vtu = oneTet();
    vtu.cells.push_back({10, {0, 1, 2, 4}});
    expectRefused(folder.write("a.vtu", vtu.text()), {"cell 1", "index 4", "4 points"});
    vtu.cells.back().nodes[3] = -1;
    expectRefused(folder.write("b.vtu", vtu.text()), {"cell 1", "index -1"});
    vtu.cells.back().nodes[3] = 2000000000;
    expectRefused(folder.write("c.vtu", vtu.text()), {"cell 1", "2000000000"});
    vtu.cells.back() = {12, {0, 1, 2, 3}};
    expectRefused(folder.write("d.vtu", vtu.text()), {"cell 1", "has 4 nodes", "8"});
    const std::string sound = oneTet().text();
    expectRefused(folder.write("e.vtu", replaced(sound, "\n4 \n", "\n-4 \n")), {});
    expectRefused(folder.write("f.vtu", replaced(sound, "\n4 \n", "\n400 \n")), {});
}

TEST(BadXml, DamagedPolyhedraAreRefused) {
    const TemporaryFolder folder;
    VtuText vtu = oneTet();
    vtu.cells = {{42, {0, 1, 2, 3}}};
    vtu.faces = "4 3 0 2 1 3 0 1 3 3 1 2 3 3 0 3 9";
    vtu.faceOffsets = "17";
    expectRefused(folder.write("a.vtu", vtu.text()), {});
    vtu.faces = "4 3 0 2 1 3 0 1 3 3 1 2 3 3 0 3 2";
    vtu.faceOffsets = "-1";
    expectRefused(folder.write("c.vtu", vtu.text()), {});
    vtu.faces.clear();
    expectRefused(folder.write("d.vtu", vtu.text()), {});
}

TEST(BadGeometry, CoordinatesThatAreNotFiniteAreNamed) {
    const TemporaryFolder folder;
    VtuText vtu = oneTet();
    vtu.points.insert(vtu.points.begin(), Vec3d(NAN));  // no cell uses it, so it does no harm
    vtu.cells[0].nodes = {1, 2, 3, 4};
    vtu.pointArrays[0].values = "0 1 2 3 4";
    EXPECT_EQ(readMesh(folder.write("good.vtu", vtu.text()), {}, {}).mesh.nodeCount(), 4);
    vtu.points[3].y = NAN;
    expectRefused(folder.write("a.vtu", vtu.text()), {"node 3", "finite"});
    folder.write("b.node", "4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 inf 0\n3 0 0 1\n");
    folder.write("b.ele", "1 4 0\n0 0 1 2 3\n");
    expectRefused(folder.file("b.node"), {"node 2", "finite"});
}

TEST(BadGeometry, MeshesWithoutSolidCellsAreRefused) {
    const TemporaryFolder folder;
    VtuText vtu = oneTet();
    vtu.cells = {{5, {0, 1, 2}}, {1, {3}}};
    expectRefused(folder.write("a.vtu", vtu.text()), {"no 3D cells", "2"});
    vtu.cells = {};
    expectRefused(folder.write("b.vtu", vtu.text()), {"no 3D cells"});
    vtu = oneTet();
    vtu.cellArrays.push_back({"vtkGhostType", "UInt8", 1, "1"});
    expectRefused(folder.write("c.vtu", vtu.text()), {"no 3D cells", "1 blanked"});
    expectRefused(
        folder.write("d.vtk",
                     "# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 4 4 1\n"
                     "ORIGIN 0 0 0\nSPACING 1 1 1\n"),
        {"no 3D cells"});
    vtu = oneTet();
    vtu.cells = {{10, {0, 0, 1, 2}}};
    const MeshFile collapsed = readMesh(folder.write("e.vtu",
                                                     [&] {
                                                         VtuText two = oneTet();
                                                         two.cells.push_back({10, {0, 0, 1, 2}});
                                                         return two.text();
                                                     }()),
                                        {}, {});
    EXPECT_EQ(collapsed.mesh.elementCount(), 1);
    expectRefused(folder.write("f.vtu", vtu.text()), {"collapsed"});
}

TEST(BadGeometry, FlatAndInvertedElementsAreOnlyCounted) {
    const TemporaryFolder folder;
    VtuText vtu = oneTet();
    vtu.points.push_back({1, 1, 0});
    vtu.pointArrays[0].values = "1 2 3 4 5";
    vtu.cells = {{10, {0, 1, 2, 4}}, {10, {1, 0, 2, 3}}};
    const MeshFile file = readMesh(folder.write("a.vtu", vtu.text()), {}, {});
    EXPECT_EQ(file.statistics.flat, 1);
    EXPECT_EQ(file.statistics.inverted, 1);
    EXPECT_EQ(file.mesh.elementCount(), 2);
}

TEST(BadField, UnknownNamesListThoseThereAre) {
    const TemporaryFolder folder;
    VtuText vtu = oneTet();
    vtu.pointArrays.push_back({"label", "String", 1, "97 0 98 0 99 0 100 0"});
    vtu.pointArrays.push_back({"ten", "Float64", 10, VtuText::numbers(40)});
    vtu.cellArrays.push_back({"region", "Int32", 1, "3"});
    const std::string path = folder.write("a.vtu", vtu.text());
    expectRefused(path, {"no field 'T'", "f", "region"}, {{"T"}, -1});
    expectRefused(path, {"'label'", "numeric"}, {{"f", "label"}, -1});
    expectRefused(path, {"'ten'", "10 components"}, {{"ten"}, -1});
    expectRefused(path, {"time step 3"}, {{}, 3});
}

TEST(BadLegacy, TruncatedAndGarbledFilesAreRefused) {
    const TemporaryFolder folder;
    const std::string text =
        "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n0 0 0 1 0 0 0 "
        "1 0 0 0 1\n"
        "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 4\nSCALARS f double 1\nLOOKUP_TABLE default\n1 2 "
        "3 4\n";
    EXPECT_EQ(readMesh(folder.write("good.vtk", text), {}, {}).mesh.elementCount(), 1);
    for (std::size_t length = 5; length < text.find("POINT_DATA") - 4; length += 5)
        expectRefused(folder.write("t.vtk", text.substr(0, length)), {});
    expectRefused(folder.write("u.vtk", text.substr(0, text.size() - 6)), {});
    expectRefused(folder.write("v.vtk", replaced(text, "POINTS 4", "POINTS 4000000000")),
                  {"POINTS 4000000000"});
    expectRefused(folder.write("w.vtk", replaced(text, "4 0 1 2 3", "4 0 1 2 7")), {"cell 0", "index 7"});
    expectRefused(folder.write("x.vtk", replaced(text, "4 0 1 2 3", "9 0 1 2 3")), {});
    expectRefused(folder.write("y.vtk", replaced(text, "0 0 0 1 0", "0 0 zero 1 0")), {});
    expectRefused(folder.write("z.vtk", replaced(text, "UNSTRUCTURED_GRID", "MARSHMALLOW")), {});
}

TEST(BadTetgen, TheLineIsNamed) {
    const TemporaryFolder folder;
    const std::string nodes = "4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n",
                      elements = "1 4 0\n0 0 1 2 3\n";
    const auto refuse = [&](const std::string& node, const std::string& element,
                            const std::vector<std::string>& words) {
        folder.write("m.node", node);
        folder.write("m.ele", element);
        expectRefused(folder.file("m.ele"), words);
    };
    refuse(replaced(nodes, "2 0 1 0", "2 0 one 0"), elements, {"m.node", "line 4", "'one'"});
    refuse(replaced(nodes, "2 0 1 0", "5 0 1 0"), elements, {"m.node", "line 4", "expected 2"});
    refuse(replaced(nodes, "3 0 0 1\n", ""), elements, {"m.node", "line 4", "expected a node"});
    refuse(replaced(nodes, "3 0 0 1\n", "3 0 0\n"), elements, {"m.node", "line 5"});
    refuse(replaced(nodes, "4 3 0 0", "4 2 0 0"), elements, {"m.node", "line 1", "dimension"});
    refuse(replaced(nodes, "4 3 0 0", "4000000 3 0 0"), elements, {"m.node", "line 1"});
    refuse(replaced(nodes, "0 0 0 0", "7 0 0 0"), elements, {"m.node", "line 2", "expected 0 or 1"});
    refuse(replaced(nodes, "4 3 0 0", "9 3 0 0"), elements, {"m.node", "line 1", "declares 9"});
    refuse(nodes, replaced(elements, "1 4 0", "3 4 0"), {"m.ele", "line 1", "declares 3"});
    refuse(nodes, replaced(elements, "0 1 2 3", "0 1 2 4"), {"m.ele", "line 2", "index 4", "0 to 3"});
    refuse(nodes, replaced(elements, "0 1 2 3", "0 1 2"), {"m.ele", "line 2"});
    refuse(nodes, replaced(elements, "1 4 0", "1 5 0"), {"m.ele", "line 1", "4 or 10"});
    refuse(nodes, replaced(elements, "1 4 0", "2 4 0") + "# a comment", {"m.ele", "expected an element"});
    refuse(nodes, "0 4 0\n", {"no 3D cells"});
    folder.write("lone.node", nodes);
    expectRefused(folder.file("lone.node"), {"lone.ele", "no such file"});
}

TEST(BadPieces, AMissingPieceIsRefused) {
    const TemporaryFolder folder;
    folder.write("a.vtu", oneTet().text());
    expectRefused(
        folder.write("all.pvtu",
                     "<?xml version=\"1.0\"?>\n<VTKFile type=\"PUnstructuredGrid\" version=\"0.1\" "
                     "byte_order=\"LittleEndian\">\n"
                     "<PUnstructuredGrid GhostLevel=\"0\"><PPoints><PDataArray type=\"Float64\" "
                     "NumberOfComponents=\"3\"/></PPoints>"
                     "<Piece Source=\"a.vtu\"/><Piece Source=\"gone.vtu\"/></PUnstructuredGrid></VTKFile>\n"),
        {"gone.vtu"});
    expectRefused(folder.write("all.vtm",
                               "<?xml version=\"1.0\"?>\n<VTKFile type=\"vtkMultiBlockDataSet\" "
                               "version=\"1.0\"><vtkMultiBlockDataSet>"
                               "<DataSet index=\"0\" file=\"a.vtu\"/><DataSet index=\"1\" file=\"gone.vtu\"/>"
                               "</vtkMultiBlockDataSet></VTKFile>\n"),
                  {"gone.vtu"});
}

TEST(Cancel, StopsReading) {
    std::atomic<bool> cancel{true};
    Execution execution;
    execution.cancel = &cancel;
    EXPECT_THROW(readMesh(TESSERA_DATA_DIR "/disk_out_ref/disk_out_ref.vtu", {}, execution), Cancelled);
}

}  // namespace
}  // namespace tessera
