#include "mesh_files/mesh_series.h"
#include "mesh/field_range.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "mesh_files/read_mesh.h"
#include "mesh_test_tools.h"
#include "tessera/error.h"
#include "vtu_text.h"

namespace tessera {
namespace {

using test::sumOfVolumes;
using test::TemporaryFolder;
using test::VtuText;

using Files = std::vector<std::string>;

/// The files of every step.
std::vector<Files> filesOf(const std::vector<SeriesStep>& steps) {
    std::vector<Files> files;
    for (const SeriesStep& step : steps) files.push_back(step.files);
    return files;
}

std::string pvd(const std::string& entries) {
    return "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\"><Collection>\n" + entries +
           "</Collection></VTKFile>\n";
}

std::string entry(const std::string& attributes) {
    return "<DataSet " + attributes + "/>\n";
}

/// A folder with some files that exist; what is in them doesn't matter.
class MeshSeries : public testing::Test {
  protected:
    void SetUp() override {
        for (const char* name :
             {"run_10.vtu", "run_2.vtu", "run_1.vtu", "run_007.vtu", "a & b.vtu", "other.txt"})
            folder_.write(name, "x");
    }
    std::vector<SeriesStep> list(const Files& names) const {
        Files paths;
        for (const std::string& name : names) paths.push_back(folder_.file(name));
        return listSeries(paths);
    }
    std::vector<SeriesStep> collection(const std::string& entries) const {
        return listSeries(Files{folder_.write("s.pvd", pvd(entries))});
    }
    /// The message of the error that listing ends with.
    template <class List>
    std::string errorOf(const List& list) const {
        try {
            list();
        } catch (const InputError& error) {
            EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
            return error.what();
        }
        ADD_FAILURE() << "no error";
        return {};
    }
    std::string errorOf(const std::string& entries) const {
        return errorOf([&] { collection(entries); });
    }
    std::string path(const std::string& name) const { return folder_.file(name); }
    const TemporaryFolder folder_;
};

TEST_F(MeshSeries, PatternsAreSortedByTheNumbersInNames) {
    const std::vector<Files> expected{
        {path("run_1.vtu")}, {path("run_2.vtu")}, {path("run_007.vtu")}, {path("run_10.vtu")}};
    EXPECT_EQ(filesOf(list({"run_*.vtu"})), expected);
    EXPECT_EQ(list({"run_?.vtu"}).size(), 2u);
    EXPECT_EQ(filesOf(list({"other.txt"})), std::vector<Files>{{path("other.txt")}});
    EXPECT_THROW(list({"none_*.vtu"}), InputError);
    EXPECT_THROW(list({"none.vtu"}), InputError);
}

TEST_F(MeshSeries, NamesThatTheShellExpandedAreSortedTheSameWay) {
    const std::vector<SeriesStep> steps = list({"run_007.vtu", "run_1.vtu", "run_10.vtu", "run_2.vtu"});
    EXPECT_EQ(filesOf(steps), filesOf(list({"run_*.vtu"})));
    for (std::size_t i = 0; i < steps.size(); ++i) {
        EXPECT_EQ(steps[i].number, i);
        EXPECT_FALSE(steps[i].time);
        EXPECT_TRUE(steps[i].collection.empty());
    }
    EXPECT_EQ(list({"run_?.vtu", "run_10.vtu"}).size(), 3u);
}

TEST_F(MeshSeries, AMeshNamedTwiceIsAnError) {
    EXPECT_NE(errorOf([&] {
                  list({"run_1.vtu", "run_2.vtu", "run_1.vtu"});
              }).find("twice"),
              std::string::npos);
    EXPECT_THROW(list({"run_1.vtu", "./run_1.vtu"}), InputError);
    EXPECT_THROW(list({"run_*.vtu", "run_2.vtu"}), InputError);
    // A link is a step of its own: it holds a frame.
    std::filesystem::create_symlink("run_2.vtu", path("run_3.vtu"));
    EXPECT_EQ(list({"run_?.vtu"}).size(), 3u);
}

TEST_F(MeshSeries, ACollectionIsInTheOrderOfItsTimes) {
    const std::vector<SeriesStep> steps =
        collection(entry("timestep=\"2.5\" part=\"0\" file=\"a &amp; b.vtu\"") +
                   "<!-- <DataSet timestep='1' file='commented.vtu'/> -->" +
                   entry("timestep=' 1e-1 ' file='run_1.vtu'"));
    EXPECT_EQ(filesOf(steps), (std::vector<Files>{{path("run_1.vtu")}, {path("a & b.vtu")}}));
    EXPECT_EQ(steps[0].time, 0.1);
    EXPECT_EQ(steps[1].time, 2.5);
    EXPECT_EQ(steps[1].collection, path("s.pvd"));
}

TEST_F(MeshSeries, WhatACollectionListsAtOneTimeAreThePartsOfOneStep) {
    const std::vector<SeriesStep> steps = collection(entry("timestep='1' part='1' file='run_2.vtu'") +
                                                     entry("timestep='0' part='0' file='run_1.vtu'") +
                                                     entry("timestep='1.0' part='0' file='run_10.vtu'") +
                                                     entry("timestep='0' part='1' file='run_007.vtu'"));
    EXPECT_EQ(filesOf(steps), (std::vector<Files>{{path("run_1.vtu"), path("run_007.vtu")},
                                                  {path("run_2.vtu"), path("run_10.vtu")}}));
    EXPECT_EQ(steps[1].number, 1u);
    // Parts need no numbers, and groups number theirs apart.
    EXPECT_EQ(
        collection(entry("timestep='1' file='run_1.vtu'") + entry("timestep='1' file='run_2.vtu'")).size(),
        1u);
    EXPECT_EQ(collection(entry("timestep='1' part='0' group='a' file='run_1.vtu'") +
                         entry("timestep='1' part='0' group='b' file='run_2.vtu'"))
                  .size(),
              1u);
}

TEST_F(MeshSeries, ACollectionWithoutTimesHasAStepForEveryFile) {
    const std::vector<SeriesStep> steps = collection(entry("file='run_2.vtu'") + entry("file='run_1.vtu'"));
    EXPECT_EQ(filesOf(steps), (std::vector<Files>{{path("run_2.vtu")}, {path("run_1.vtu")}}));
    EXPECT_FALSE(steps[0].time);
    const std::vector<SeriesStep> parts =
        collection(entry("part='0' file='run_2.vtu'") + entry("part='1' file='run_1.vtu'"));
    EXPECT_EQ(filesOf(parts), (std::vector<Files>{{path("run_2.vtu"), path("run_1.vtu")}}));
}

TEST_F(MeshSeries, CollectionsThatGoWrongSayWhere) {
    const auto expectError = [&](const std::string& entries, const std::string& words) {
        const std::string message = errorOf(entries);
        EXPECT_NE(message.find(words), std::string::npos) << message;
        EXPECT_TRUE(message.starts_with(path("s.pvd"))) << message;
    };
    const std::string good = entry("timestep='0' part='0' file='run_1.vtu'");
    expectError(entry("timestep='0' file='gone.vtu'"), "byte 76: names " + path("gone.vtu"));
    expectError(good + entry("timestep='0' part='1' file='gone.vtu'"), "which doesn't exist");
    for (const char* time : {"soon", "1x", "", "nan", "inf", "1 2"})
        expectError(good + entry(std::string("timestep='") + time + "' file='run_2.vtu'"),
                    "expected a number");
    expectError(good + entry("file='run_2.vtu'"), "without a timestep");
    expectError(entry("file='run_2.vtu'") + good, "with a timestep");
    expectError(good + entry("timestep='1'"), "without a file");
    expectError(good + entry("timestep='0' part='0' file='run_2.vtu'"),
                "part 0 of timestep 0 is listed twice");
    expectError(entry("timestep='3' file='run_1.vtu'") + entry("timestep='3' file='./run_1.vtu'"),
                "twice at timestep 3");
    expectError(entry("timestep='0' file='s.pvd'"), "a .pvd file");
    folder_.write("t.pvd", pvd(good));
    expectError(entry("timestep='0' file='t.pvd'"), "a .pvd file");
    expectError(entry("timestep='0' file='.'"), "isn't a regular file");
    expectError(entry("timestep='0' file='/dev/zero'"), "isn't a regular file");
    expectError("", "names no files");
    std::string many;
    for (int i = 0; i <= 100000; ++i) many += entry("file='run_1.vtu'");
    expectError(many, "more than 100,000 files are named");
}

TEST_F(MeshSeries, WhatIsNoCollectionIsAnError) {
    EXPECT_THROW(listSeries(Files{folder_.write("x.pvd", "nothing")}), InputError);
    EXPECT_THROW(listSeries(Files{folder_.write("x.pvd", "")}), InputError);
    EXPECT_THROW(listSeries(Files{folder_.write("x.pvd", "<VTKFile type=\"UnstructuredGrid\"></VTKFile>")}),
                 InputError);
    const std::string whole = pvd(entry("timestep='0' file='run_1.vtu'"));
    EXPECT_THROW(listSeries(Files{folder_.write("x.pvd", whole.substr(0, whole.size() - 12))}), InputError);
    std::filesystem::create_directory(path("d.pvd"));
    EXPECT_THROW(list({"d.pvd"}), InputError);
    std::filesystem::create_symlink("/dev/zero", path("zero.pvd"));
    EXPECT_THROW(list({"zero.pvd"}), InputError);
}

TEST_F(MeshSeries, ACollectionStandsAlone) {
    folder_.write("s.pvd", pvd(entry("timestep='0' file='run_1.vtu'")));
    EXPECT_EQ(list({"*.pvd"}).size(), 1u);
    EXPECT_NE(errorOf([&] { list({"run_2.vtu", "s.pvd"}); }).find("series of its own"), std::string::npos);
}

TEST_F(MeshSeries, TimesChooseSteps) {
    const std::vector<SeriesStep> steps = collection(
        entry("timestep='0' file='run_1.vtu'") + entry("timestep='0.30000000000000004' file='run_2.vtu'") +
        entry("timestep='2' file='run_10.vtu'"));
    const auto numbers = [&](const TimeRange& range) {
        std::vector<std::size_t> found;
        for (const SeriesStep& step : stepsWithin(steps, range)) found.push_back(step.number);
        return found;
    };
    EXPECT_EQ(numbers({0.0, 0.3}), (std::vector<std::size_t>{0, 1}));
    EXPECT_EQ(numbers({0.3, std::nullopt}), (std::vector<std::size_t>{1, 2}));
    EXPECT_EQ(numbers({std::nullopt, 1.0}), (std::vector<std::size_t>{0, 1}));
    EXPECT_EQ(numbers({2.0, 2.0}), (std::vector<std::size_t>{2}));
    EXPECT_NE(errorOf([&] { numbers({0.5, 1.5}); }).find("from 0 to 2"), std::string::npos);
    EXPECT_THROW(stepsWithin(list({"run_1.vtu"}), {0.0, 1.0}), InputError);
}

/// A box of n x 1 x 1 unit hexahedra from x = first on, its nodes shifted so that no face but those at ends
/// is flat.
VtuText hexahedra(int first, int n, const std::string& type = "f") {
    VtuText vtu;
    std::string values;
    for (int i = first; i <= first + n; ++i)
        for (int j = 0; j < 2; ++j)
            for (int k = 0; k < 2; ++k) {
                vtu.points.push_back({i + 0.125 * j * k, double(j), double(k)});
                values += std::to_string(i * i + j) + " ";
            }
    for (int c = 0; c < n; ++c) {
        const int a = 4 * c, b = 4 * c + 4;
        vtu.cells.push_back({12, {a, b, b + 2, a + 2, a + 1, b + 1, b + 3, a + 3}});
    }
    vtu.pointArrays.push_back({type, "Float64", 1, values});
    return vtu;
}

class Parts : public testing::Test {
  protected:
    MeshFile read(const std::vector<std::string>& parts, int threads = 0) const {
        Execution execution;
        execution.threads = threads;
        ReadOptions options;
        options.otherParts.assign(parts.begin() + 1, parts.end());
        MeshFile file = readMesh(parts[0], options, execution);
        checkMesh(file.mesh);
        return file;
    }
    const TemporaryFolder folder_;
};

TEST_F(Parts, AreOneConformingMesh) {
    const MeshFile whole = read({folder_.write("whole.vtu", hexahedra(0, 5).text())});
    const std::vector<std::string> parts{folder_.write("a.vtu", hexahedra(0, 2).text()),
                                         folder_.write("b.vtu", hexahedra(2, 1).text()),
                                         folder_.write("c.vtu", hexahedra(3, 2).text())};
    const MeshFile joined = read(parts);
    EXPECT_EQ(joined.mesh.nodeCount(), whole.mesh.nodeCount());
    EXPECT_EQ(joined.mesh.points, whole.mesh.points);  // here the order is the same too
    EXPECT_EQ(joined.mesh.tets, whole.mesh.tets);
    EXPECT_EQ(joined.mesh.fields[0].values, whole.mesh.fields[0].values);
    EXPECT_EQ(joined.statistics.coincidentNodes + joined.statistics.nonConformingFaces, 0);
    EXPECT_EQ(joined.statistics.cells, 5);
    EXPECT_EQ(joined.statistics.blocks, 3);
    EXPECT_TRUE(joined.statistics.warnings.empty());
    for (const int threads : {1, 2, 5}) EXPECT_EQ(read(parts, threads).mesh.tets, joined.mesh.tets);
}

TEST_F(Parts, GhostCellsCountOnce) {
    VtuText left = hexahedra(0, 3), right = hexahedra(2, 3);  // each holds one cell of the other
    left.cellArrays.push_back({"vtkGhostType", "UInt8", 1, "0 0 0"});
    right.cellArrays.push_back({"vtkGhostType", "UInt8", 1, "1 0 0"});
    const MeshFile file = read({folder_.write("a.vtu", left.text()), folder_.write("b.vtu", right.text())});
    EXPECT_EQ(file.statistics.cells, 5);
    EXPECT_EQ(file.statistics.blankedCells, 1);
    EXPECT_EQ(file.statistics.duplicate + file.statistics.nonConformingFaces, 0);
    EXPECT_NEAR(sumOfVolumes(file.mesh), 5, 1e-12);
    EXPECT_EQ(file.mesh.nodeCount(), 24);
}

TEST_F(Parts, JumpsOfAFieldStay) {
    VtuText right = hexahedra(2, 1);
    right.pointArrays[0].values = "40 4.0000001 6 5 9 9 9 9";  // 4 4 5 5 on the left
    const MeshFile file =
        read({folder_.write("a.vtu", hexahedra(0, 2).text()), folder_.write("b.vtu", right.text())});
    // The second differs by less than the resolution of a float, over the largest value.
    EXPECT_EQ(file.mesh.nodeCount(), 12 + 8 - 2);
    ASSERT_EQ(file.statistics.warnings.size(), 1u);
    EXPECT_NE(file.statistics.warnings[0].find("2 nodes"), std::string::npos) << file.statistics.warnings[0];
    EXPECT_NEAR(sumOfVolumes(file.mesh),
                sumOfVolumes(read({folder_.write("w.vtu", hexahedra(0, 3).text())}).mesh), 1e-12);
}

TEST_F(Parts, NodesOfOnePartStayApart) {
    // Both parts have every node twice, as discontinuous methods write them: the sides of a slit at z = 0.
    const auto slit = [](double x) {
        VtuText vtu;
        vtu.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {x, 0, 1},
                      {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {x, 0, -1}};
        vtu.cells = {{10, {0, 1, 2, 3}}, {10, {4, 6, 5, 7}}};
        vtu.pointArrays.push_back({"f", "Float64", 1, "1 1 1 1 2 2 2 2"});
        return vtu.text();
    };
    const MeshFile file = read({folder_.write("a.vtu", slit(0.25)), folder_.write("b.vtu", slit(0.75))});
    EXPECT_EQ(file.mesh.nodeCount(), 8 + 2);
    EXPECT_EQ(file.statistics.coincidentNodes, 3);
    EXPECT_TRUE(file.statistics.warnings.empty());
    for (const auto& tet : file.mesh.tets)
        for (const std::int32_t node : tet)
            EXPECT_EQ(file.mesh.fields[0].at(node, 0), file.mesh.points[std::size_t(tet[3])].z > 0 ? 1 : 2);
}

TEST_F(Parts, FieldsThatSomeLackAreNanThereAndNamed) {
    const std::string a = folder_.write("a.vtu", hexahedra(0, 1, "f").text());
    const std::string b = folder_.write("b.vtu", hexahedra(1, 1, "g").text());
    const MeshFile file = read({a, b});
    EXPECT_EQ(file.mesh.nodeCount(), 12);
    ASSERT_EQ(file.mesh.fields.size(), 2u);
    EXPECT_EQ(fieldRange(file.mesh.fields[0], 0).max, 2);  // nodes of both parts have both
    ASSERT_EQ(file.statistics.warnings.size(), 1u);
    const std::string& warning = file.statistics.warnings[0];
    EXPECT_NE(warning.find("2 fields are absent in some parts"), std::string::npos) << warning;
    EXPECT_NE(warning.find("f, g"), std::string::npos) << warning;
}

TEST_F(Parts, OnePartMayHaveNoCells) {
    VtuText none;
    const std::string a = folder_.write("a.vtu", hexahedra(0, 1).text()),
                      b = folder_.write("b.vtu", none.text());
    for (const auto& parts : {std::vector<std::string>{a, b}, std::vector<std::string>{b, a}}) {
        const MeshFile file = read(parts);
        EXPECT_EQ(file.statistics.cells, 1);
        ASSERT_EQ(file.statistics.warnings.size(), 1u);
        EXPECT_NE(file.statistics.warnings[0].find(b), std::string::npos);
    }
}

TEST_F(Parts, ErrorsNameThePart) {
    const auto messageOf = [&](const std::string& second) {
        try {
            read({folder_.write("a.vtu", hexahedra(0, 1).text()), second});
        } catch (const InputError& error) {
            return std::string(error.what());
        }
        return std::string("no error");
    };
    VtuText far = hexahedra(1, 1);
    far.points[3].x = std::nan("");
    const std::string nan = folder_.write("nan.vtu", far.text()), empty = folder_.write("empty.vtu", "");
    EXPECT_TRUE(messageOf(nan).starts_with(nan + ": node 3 (counted from 0) has a coordinate"))
        << messageOf(nan);
    EXPECT_TRUE(messageOf(empty).starts_with(empty + ": the file is empty"));
    EXPECT_TRUE(messageOf(folder_.file("gone.vtu")).starts_with(folder_.file("gone.vtu")));
    const std::string other =
        folder_.write("grid.vtk",
                      "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\n"
                      "ORIGIN 1 0 0\nSPACING 1 1 1\n");
    EXPECT_TRUE(messageOf(other).starts_with(other + ": is of another kind (VTK legacy)"))
        << messageOf(other);
}

TEST_F(Parts, ManyPointsAtOnePlaceTakeNoSquareOfTheirNumber) {
    constexpr int kCount = 100000;
    const auto heap = [&](const char* value) {
        VtuText vtu;
        std::string values;
        for (int i = 0; i < kCount; ++i) vtu.points.push_back({0, 0, 0}), values += value;
        vtu.points.insert(vtu.points.end(), {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
        for (int i = 0; i < kCount; ++i) vtu.cells.push_back({10, {i, kCount, kCount + 1, kCount + 2}});
        vtu.pointArrays.push_back({"f", "Float64", 1, values + "0 0 0"});
        return vtu.text();
    };
    const MeshFile file = read({folder_.write("a.vtu", heap("1 ")), folder_.write("b.vtu", heap("2 "))});
    EXPECT_EQ(file.mesh.nodeCount(), 2 * kCount + 3);
}

}  // namespace
}  // namespace tessera
