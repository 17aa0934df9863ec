#include "mesh_files/read_vtu.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <limits>
#include <set>

#include "mesh_files/read_mesh.h"
#include "mesh_test_tools.h"
#include "tessera/error.h"
#include "vtu_text.h"

namespace tessera {
namespace {

using test::bytesOf;
using test::TemporaryFolder;
using test::VtuText;

/// A file in the making whose arrays are appended as raw bytes.
struct RawVtu {
    bool isPacked = true, hasWideHeaders = true;
    std::size_t blockBytes = 4096;
    std::string version = "1.0", comment;
    std::string key;  // in every array, empty or a whole element

    std::vector<Vec3d> points;
    std::vector<std::int64_t> nodes, offsets;
    std::vector<int> types;
    std::vector<double> values, cellValues;

    template <class Coordinate, class Index>
    std::string text() const {
        std::string appended, markup;
        const auto add = [&](const char* type, const char* name, int components, const std::string& bytes) {
            markup += std::string("<DataArray type=\"") + type + "\" Name=\"" + name +
                      "\" NumberOfComponents=\"" + std::to_string(components) +
                      "\" format=\"appended\" offset=\"" + std::to_string(appended.size()) + "\">\n" + key +
                      "</DataArray>\n";
            appended += packed(bytes);
        };
        const auto open = [&](const std::string& tag) { markup += "<" + tag + ">\n"; };
        const bool isDouble = sizeof(Coordinate) == 8, isLong = sizeof(Index) == 8;
        open("PointData Scalars=\"f\"");
        add("Float64", "f", 1, bytesOf<double>(values));
        open("/PointData");
        open("CellData");
        add("Int16", "c", 3, bytesOf<std::int16_t>(cellValues));
        open("/CellData");
        open("Points");
        std::vector<double> coordinates;
        for (const Vec3d& p : points) coordinates.insert(coordinates.end(), {p.x, p.y, p.z});
        add(isDouble ? "Float64" : "Float32", "Points", 3, bytesOf<Coordinate>(coordinates));
        open("/Points");
        open("Cells");
        add(isLong ? "Int64" : "Int32", "connectivity", 1, bytesOf<Index>(nodes));
        add(isLong ? "Int64" : "Int32", "offsets", 1, bytesOf<Index>(offsets));
        add("UInt8", "types", 1, bytesOf<std::uint8_t>(types));
        open("/Cells");
        return "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"" + version +
               "\" byte_order=\"LittleEndian\" header_type=\"" + (hasWideHeaders ? "UInt64" : "UInt32") +
               "\"" + (isPacked ? " compressor=\"vtkZLibDataCompressor\"" : "") + ">\n<UnstructuredGrid>\n" +
               comment + "<Piece NumberOfPoints=\"" + std::to_string(points.size()) + "\" NumberOfCells=\"" +
               std::to_string(types.size()) + "\">\n" + markup +
               "</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_" + appended +
               "\n</AppendedData>\n</VTKFile>\n";
    }

    std::string word(std::size_t value) const {
        return hasWideHeaders ? bytesOf<std::uint64_t>(std::vector{value})
                              : bytesOf<std::uint32_t>(std::vector{value});
    }

    std::string packed(const std::string& bytes) const {
        if (!isPacked) return word(bytes.size()) + bytes;
        std::string sizes, blocks;
        std::size_t count = 0;
        for (std::size_t at = 0; at < bytes.size(); at += blockBytes, ++count) {
            const std::string block = bytes.substr(at, blockBytes);
            uLongf length = compressBound(block.size());
            std::string out(length, '\0');
            compress(reinterpret_cast<Bytef*>(out.data()), &length,
                     reinterpret_cast<const Bytef*>(block.data()), block.size());
            sizes += word(length);
            blocks += out.substr(0, length);
        }
        return word(count) + word(blockBytes) + word(bytes.size() % blockBytes) + sizes + blocks;
    }
};

/// Places and values that both floats and text keep; every seventh node is unused.
RawVtu manyTets() {
    RawVtu file;
    std::uint64_t state = 7;
    const auto below = [&](std::uint64_t n) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        return std::int64_t((state >> 33) % n);
    };
    for (int i = 0; i < 600; ++i) {
        file.points.emplace_back(double(below(1000)) / 8, double(below(1000)) / 8, double(below(1000)) / 8);
        file.values.push_back(i % 100 == 3 ? std::numeric_limits<double>::quiet_NaN() : 1.0 / (i + 1));
    }
    while (file.types.size() < 1500) {
        std::set<std::int64_t> tet;
        while (tet.size() < 4)
            if (const std::int64_t node = below(600); node % 7 != 0) tet.insert(node);
        file.nodes.insert(file.nodes.end(), tet.begin(), tet.end());
        file.offsets.push_back(std::int64_t(file.nodes.size()));
        file.types.push_back(10);
        for (int k = 0; k < 3; ++k) file.cellValues.push_back(double(below(60000)) - 30000);
    }
    return file;
}

/// The same mesh in a form that VTK's reader reads.
std::string asText(const RawVtu& file) {
    VtuText text;
    text.points = file.points;
    for (std::size_t c = 0; c < file.types.size(); ++c)
        text.cells.push_back(
            {10,
             {file.nodes.begin() + 4 * std::ptrdiff_t(c), file.nodes.begin() + 4 * std::ptrdiff_t(c + 1)}});
    std::string values, cellValues;
    for (const double v : file.values) values += VtuText::number(v) + " ";
    for (const double v : file.cellValues) cellValues += VtuText::number(v) + " ";
    text.pointArrays = {{"f", "Float64", 1, values}};
    text.cellArrays = {{"c", "Int16", 3, cellValues}};
    return text.text();
}

void expectSame(const MeshFile& read, const MeshFile& expected) {
    EXPECT_EQ(read.mesh.points, expected.mesh.points);
    EXPECT_EQ(read.mesh.tets, expected.mesh.tets);
    ASSERT_EQ(read.mesh.fields.size(), expected.mesh.fields.size());
    for (std::size_t f = 0; f < read.mesh.fields.size(); ++f) {
        const Field &a = read.mesh.fields[f], &b = expected.mesh.fields[f];
        EXPECT_EQ(a.name, b.name);
        EXPECT_EQ(a.location, b.location);
        EXPECT_EQ(a.components, b.components);
        ASSERT_EQ(a.values.size(), b.values.size());
        for (std::size_t i = 0; i < a.values.size(); ++i)
            ASSERT_TRUE(a.values[i] == b.values[i] || (std::isnan(a.values[i]) && std::isnan(b.values[i])));
    }
    EXPECT_EQ(read.statistics.format, expected.statistics.format);
    EXPECT_EQ(read.statistics.cells, expected.statistics.cells);
    EXPECT_EQ(read.statistics.cellsOfKind, expected.statistics.cellsOfKind);
    EXPECT_EQ(read.statistics.nodes, expected.statistics.nodes);
    EXPECT_EQ(read.statistics.boundaryFaces, expected.statistics.boundaryFaces);
    EXPECT_EQ(read.statistics.warnings, expected.statistics.warnings);
}

class ReadPlainVtu : public testing::Test {
  protected:
    /// @param plain whether no other reader is needed.
    void expectReads(const std::string& text, const MeshFile& expected, bool plain,
                     const ReadOptions& options = {}) const {
        const std::string path = folder_.write("mesh.vtu", text);
        EXPECT_EQ(readPlainVtu(path, options, {}).has_value(), plain);
        for (const int threads : {1, 3}) {
            Execution execution;
            execution.threads = threads;
            expectSame(readMesh(path, options, execution), expected);
        }
    }
    TemporaryFolder folder_;
};

TEST_F(ReadPlainVtu, GivesWhatVtkReads) {
    RawVtu file = manyTets();
    const MeshFile expected = readMesh(folder_.write("text.vtu", asText(file)), {}, {});
    EXPECT_LT(expected.statistics.nodes, 600) << "unused nodes are dropped";
    for (const bool isPacked : {false, true})
        for (const bool isWide : {false, true}) {
            file.isPacked = isPacked;
            file.hasWideHeaders = isWide;
            expectReads(file.text<double, std::int64_t>(), expected, true);
            expectReads(file.text<float, std::int32_t>(), expected, true);
        }
    file.key =
        "<InformationKey name=\"L2_NORM_RANGE\" location=\"vtkDataArray\" length=\"2\">\n"
        "  <Value index=\"0\">\n    0\n  </Value>\n  <Value index=\"1\">\n    1.7e-3\n  </Value>\n"
        "</InformationKey>\n";
    file.blockBytes = 20000;  // some arrays fill none
    file.isPacked = true;
    expectReads(file.text<double, std::int32_t>(), expected, true);
}

TEST_F(ReadPlainVtu, ReadsTheFieldsAskedFor) {
    const RawVtu file = manyTets();
    for (const char* name : {"f", "cell:c"}) {
        ReadOptions options;
        options.fields = {name};
        const MeshFile expected = readMesh(folder_.write("text.vtu", asText(file)), options, {});
        expectReads(file.text<double, std::int64_t>(), expected, true, options);
    }
}

TEST_F(ReadPlainVtu, LeavesOtherFormsToVtk) {
    RawVtu file = manyTets();
    const MeshFile expected = readMesh(folder_.write("text.vtu", asText(file)), {}, {});
    file.key = "<InformationKey name=\"GUI_HIDE\" location=\"vtkAbstractArray\"/>\n";
    EXPECT_FALSE(readPlainVtu(folder_.write("key.vtu", file.text<double, std::int64_t>()), {}, {}));
    file.key = "";
    file.comment = "<!-- a comment -->\n";
    expectReads(file.text<double, std::int64_t>(), expected, false);
    file.comment = "";
    file.blockBytes = 4094;  // values lie in two blocks
    expectReads(file.text<double, std::int64_t>(), expected, false);

    file = manyTets();
    file.nodes[41] = file.nodes[40];
    expectReads(file.text<double, std::int64_t>(), readMesh(folder_.write("text.vtu", asText(file)), {}, {}),
                false);
}

TEST_F(ReadPlainVtu, LeavesToVtkWhatItWarnsOf) {
    RawVtu file = manyTets();
    file.version = "9.9";
    const std::string newer = file.text<double, std::int64_t>();
    file.version = "1.0";
    std::string noVectors = file.text<double, std::int64_t>();
    noVectors.replace(noVectors.find("Scalars"), 7, "Vectors");
    for (const std::string& text : {newer, noVectors}) {
        const std::string path = folder_.write("mesh.vtu", text);
        EXPECT_FALSE(readPlainVtu(path, {}, {}));
        EXPECT_EQ(readMesh(path, {}, {}).statistics.warnings.size(), 1u);
    }
}

TEST_F(ReadPlainVtu, LeavesDamageToVtk) {
    const auto expectRefused = [&](const std::string& text, const std::string& word) {
        const std::string path = folder_.write("damaged.vtu", text);
        EXPECT_FALSE(readPlainVtu(path, {}, {}));
        try {
            readMesh(path, {}, {});
            ADD_FAILURE() << "it was read";
        } catch (const InputError& error) {
            EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << error.what();
        }
    };
    RawVtu file = manyTets();
    file.nodes[1400 * 4 + 2] = 600;
    expectRefused(file.text<double, std::int64_t>(), "cell 1400 (counted from 0) has node index 600");
    file = manyTets();
    file.offsets[77] += 1000000;
    expectRefused(file.text<double, std::int64_t>(), "damaged.vtu");
    file = manyTets();
    const std::string sound = file.text<double, std::int64_t>();
    std::string touching = sound;
    touching.erase(touching.find(" offset="), 1);
    expectRefused(touching, "damaged.vtu");
    // Inside a block of the nodes: the checksum doesn't fit.
    std::string damaged = sound;
    const std::size_t at = damaged.find('_', damaged.find("<AppendedData")) + 1;
    damaged[at + (damaged.size() - at) / 2] ^= 4;
    expectRefused(damaged, "damaged.vtu");
}

}  // namespace
}  // namespace tessera
