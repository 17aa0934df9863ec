#include "mesh_files/read_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>

#include "mesh_test_tools.h"
#include "tessera/error.h"

namespace tessera {
namespace {

using test::TemporaryFolder;

class ReadSurface : public ::testing::Test {
  protected:
    SurfaceFile read(const std::string& name, const std::string& text) {
        return readSurface(folder_.write(name, text), {}, {});
    }
    /// What an InputError says, behind the file's name.
    std::string refusal(const std::string& name, const std::string& text) {
        try {
            read(name, text);
        } catch (const InputError& error) {
            const std::string message = error.what(), path = folder_.file(name) + ": ";
            EXPECT_TRUE(message.starts_with(path)) << message;
            return message.substr(std::min(path.size(), message.size()));
        }
        ADD_FAILURE() << "was read: " << text;
        return {};
    }
    TemporaryFolder folder_;
};

using Triangles = std::vector<std::array<std::int32_t, 3>>;

TEST_F(ReadSurface, SplitsPolygonsOfOffFiles) {
    const SurfaceFile file = read("a.off",
                                  "OFF\n# square and triangle\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 2 2\n"
                                  "4 0 1 2 3 255 0 0\n3 2 3 4\n");
    EXPECT_EQ(file.surface.points.size(), 5u);
    ASSERT_EQ(file.surface.triangles.size(), 3u);
    EXPECT_EQ(file.surface.triangles[2], (std::array<std::int32_t, 3>{2, 3, 4}));
}

TEST_F(ReadSurface, CountsIndicesOfObjFilesFromBothEnds) {
    const SurfaceFile file = read("a.obj",
                                  "o thing\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvn 0 0 1\n"
                                  "f 1//1 2//1 3//1\nf -1 -2 -3\n");
    EXPECT_EQ(file.surface.triangles, (Triangles{{0, 1, 2}, {2, 1, 0}}));
    ASSERT_EQ(file.surface.fields.size(), 1u);
    EXPECT_EQ(file.surface.fields[0].name, "color");
    EXPECT_EQ(file.surface.fields[0].values, (std::vector<double>{1, 0, 0, 0, 1, 0, 0, 0, 1}));
    EXPECT_EQ(refusal("b.obj", "v 0 0 0\nf 1 2 1\n"), "line 2: point 2 is none of the 1 before this line");
}

std::string stlTriangle(const float (&numbers)[12]) {
    std::string bytes(reinterpret_cast<const char*>(numbers), sizeof numbers);
    return bytes + std::string(2, '\0');
}

TEST_F(ReadSurface, JoinsTheCornersOfStlFiles) {
    std::string binary(84, '\0');
    std::memcpy(binary.data(), "solid, though binary", 20);
    binary[80] = 2;
    binary += stlTriangle({0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0});
    binary += stlTriangle({0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 0});
    const SurfaceFile file = read("a.stl", binary);
    EXPECT_EQ(file.surface.points.size(), 4u);
    EXPECT_EQ(file.surface.triangles, (Triangles{{0, 1, 2}, {1, 3, 2}}));
    binary.pop_back();
    EXPECT_NE(refusal("b.stl", binary.substr(5)), "");
    const std::string facet =
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
        "endloop\nendfacet\n";
    EXPECT_EQ(read("c.stl", "solid a\n" + facet + "endsolid a\n").surface.triangles, (Triangles{{0, 1, 2}}));
    EXPECT_EQ(refusal("d.stl", "solid a\n" + facet), "cut off: its last line isn't endsolid");
}

TEST_F(ReadSurface, MakesFieldsOfPlyProperties) {
    const std::string head =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty float heat\n"
        "property double y\nproperty double z\nproperty uchar red\nproperty uchar green\n"
        "property uchar blue\nelement face 1\nproperty list uchar int vertex_indices\n"
        "property float load\nend_header\n";
    const SurfaceFile file =
        read("a.ply", head + "0.1 5 0 0 1 2 3\n1 6 0 0 4 5 6\n0 7 1 0 7 8 9\n3 0 1 2 2.5\n");
    EXPECT_EQ(file.surface.points[0], Vec3d(0.1, 0, 0));
    EXPECT_EQ(file.surface.triangles, (Triangles{{0, 1, 2}}));
    ASSERT_EQ(file.surface.fields.size(), 3u);
    EXPECT_EQ(file.surface.fields[0].values, (std::vector<double>{5, 6, 7}));
    EXPECT_EQ(file.surface.fields[1].name, "color");
    EXPECT_EQ(file.surface.fields[1].components, 3);
    EXPECT_EQ(file.surface.fields[2].values, (std::vector<double>{2.5, 2.5, 2.5}));  // of the only triangle
    EXPECT_NE(refusal("b.ply", head + "0 5 0 0 1 2 3\n").find("cut off inside 'vertex'"), std::string::npos);
    std::string big =
        "ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty short x\nproperty short y\n"
        "property short z\nend_header\n";
    big += std::string("\x01\x00\xff\xff\x00\x02", 6);
    EXPECT_EQ(read("c.ply", big).surface.points[0], Vec3d(256, -1, 2));
}

TEST_F(ReadSurface, ReadsTablesOfAnyKind) {
    const auto expectPoints = [&](const std::string& text) {
        const SurfaceFile file = read("a.csv", text);
        EXPECT_EQ(file.surface.points, (std::vector<Vec3d>{{1, 2, 3}, {4, 5, 6.5}})) << text;
        EXPECT_TRUE(file.surface.triangles.empty());
        return file.surface.fields;
    };
    EXPECT_EQ(expectPoints("x,y,z,T\n1,2,3,7\n4,5,6.5,8\n")[0].values, (std::vector<double>{7, 8}));
    EXPECT_EQ(expectPoints("T;Z;Y;X\r\n7;3;2;1\r\n8;6.5;5;4\r\n")[0].name, "T");
    EXPECT_EQ(expectPoints("1 2 3 7\n  4  5 6.5 8\n")[0].name, "column_4");
    const auto vector =
        expectPoints("\"v:0\",\"v:1\",\"Points:0\",\"Points:1\",\"Points:2\"\n7,8,1,2,3\n,9,4,5,6.5\n");
    ASSERT_EQ(vector.size(), 1u);
    EXPECT_EQ(vector[0].name, "v");
    EXPECT_EQ(vector[0].components, 2);
    EXPECT_TRUE(std::isnan(vector[0].values[2]));
    EXPECT_EQ(expectPoints("# made by hand\n# x y z T\n1 2 3 7\n4 5 6.5 NA\n")[0].name, "T");
    EXPECT_EQ(expectPoints("x;y;z;T\n1,0;2;3;7,5\n4;5;6,5;8\n")[0].values, (std::vector<double>{7.5, 8}));
    EXPECT_EQ(expectPoints("x,y,z,v:1,v:0\n1,2,3,8,7\n4,5,6.5,10,9\n")[0].values,
              (std::vector<double>{7, 8, 9, 10}));
    EXPECT_EQ(expectPoints("x,y,z,v:0,v:2\n1,2,3,8,7\n4,5,6.5,10,9\n").size(), 2u);  // one is missing
    EXPECT_EQ(expectPoints("\"x\",\"y\",\"z\",\"temp; mean\"\n1,2,3,7\n4,5,6.5,8\n")[0].name, "temp; mean");
    EXPECT_EQ(read("n.csv", "lon,lat,depth\n1,2,3\n").warnings.size(), 1u);
    EXPECT_NE(refusal("o.csv", "x,y,T\n1,2,3\n").find("not all of x, y and z"), std::string::npos);
    EXPECT_NE(refusal("p.csv", "0,0,0,none\n1,2,3,4\n").find("neither names"), std::string::npos);
    EXPECT_EQ(refusal("b.csv", "x,y,z\n1,2,3\n1,2\n"), "line 3: has 2 of 3 columns");
    EXPECT_EQ(refusal("c.csv", "x,y,z\n1,2,wide\n"), "line 2: expected a number, found 'wide'");
    EXPECT_EQ(refusal("d.csv", "x,y,z,T,T\n1,2,3,4,5\n"), "line 1: two columns are called 'T'");
}

TEST_F(ReadSurface, ReadsFacetsWithHolesOfPolyFiles) {
    // A square with a square hole: 8 triangles of area 15 in all.
    std::string text =
        "8 3 0 0\n1 0 0 0\n2 4 0 0\n3 4 4 0\n4 0 4 0\n5 1 1 0\n6 2 1 0\n7 2 2 0\n8 1 2 0\n"
        "1 0\n2 1\n4 1 2 3 4\n4 5 6 7 8\n1 1.5 1.5 0\n1\n1 9 9 9\n1\n1 8 8 8 5 0.1\n";
    const SurfaceFile file = read("a.poly", text);
    double area = 0;
    for (const auto& t : file.surface.triangles) {
        const auto& p = file.surface.points;
        area += glm::length(glm::cross(p[std::size_t(t[1])] - p[std::size_t(t[0])],
                                       p[std::size_t(t[2])] - p[std::size_t(t[0])])) /
                2;
    }
    EXPECT_EQ(file.surface.triangles.size(), 8u);
    EXPECT_DOUBLE_EQ(area, 15);
    EXPECT_EQ(file.holesWorld, (std::vector<Vec3d>{{9, 9, 9}}));
    ASSERT_EQ(file.regions.size(), 1u);
    EXPECT_EQ(file.regions[0].placeWorld, Vec3d(8, 8, 8));
}

TEST_F(ReadSurface, TakesPolygonsAndPointsOfVtkFiles) {
    const std::string head =
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 4 double\n"
        "0 0 0 1 0 0 1 1 0 0 1 0\n";
    const SurfaceFile square = read("a.vtk", head +
                                                 "POLYGONS 1 5\n4 0 1 2 3\nCELL_DATA 1\nSCALARS c double 1\n"
                                                 "LOOKUP_TABLE default\n3\n");
    EXPECT_EQ(square.surface.triangles.size(), 2u);
    ASSERT_EQ(square.surface.fields.size(), 1u);
    EXPECT_EQ(square.surface.fields[0].values, (std::vector<double>{3, 3, 3, 3}));
    EXPECT_TRUE(read("b.vtk", head).surface.triangles.empty());
    EXPECT_NE(refusal("c.vtk", head + "LINES 1 3\n2 0 1\n").find("lines"), std::string::npos);
}

TEST(IsSurfaceName, KnowsNodesWithoutElements) {
    const TemporaryFolder folder;
    EXPECT_TRUE(isSurfaceName("A.STL"));
    EXPECT_FALSE(isSurfaceName("a.vtu"));
    EXPECT_TRUE(isSurfaceName(folder.file("a.node")));
    folder.write("a.ele", "0 4 0\n");
    EXPECT_FALSE(isSurfaceName(folder.file("a.node")));
}

}  // namespace
}  // namespace tessera
