#include "pictures/image_exr.h"

#include <ImathBox.h>
#include <ImathVec.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <set>

#include "mesh_test_tools.h"
#include "reference/generators.h"
#include "resample/cut_plane.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {
namespace {

using test::TemporaryFolder;

struct ReadExr {
    int width = 0, height = 0;
    std::map<std::string, std::vector<float>> channels;
    Imf::Header header;
};

/// Reads with OpenEXR itself; every channel must be of 32-bit floats.
ReadExr readExr(const std::string& path) {
    Imf::InputFile file(path.c_str());
    ReadExr result;
    result.header = file.header();
    const Imath::Box2i window = file.header().dataWindow();
    result.width = window.max.x - window.min.x + 1;
    result.height = window.max.y - window.min.y + 1;
    Imf::FrameBuffer buffer;
    const Imf::ChannelList& list = file.header().channels();
    for (auto c = list.begin(); c != list.end(); ++c) {
        EXPECT_EQ(c.channel().type, Imf::FLOAT) << c.name();
        std::vector<float>& values = result.channels[c.name()];
        values.resize(std::size_t(result.width) * std::size_t(result.height));
        buffer.insert(c.name(), Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), sizeof(float),
                                           sizeof(float) * std::size_t(result.width)));
    }
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y, window.max.y);
    return result;
}

std::string bytesOf(const std::string& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

ExrImage smallImage() {
    ExrImage image{37, 21, {}, {}, {}};
    for (const char* name : {"p", "U_x", "U_y", "coverage"}) {
        ExrChannel channel{name, {}};
        for (int i = 0; i < 37 * 21; ++i)
            channel.values.push_back(float(std::sin(i * 0.1 * double(1 + image.channels.size()))) * 1e-30f);
        image.channels.push_back(channel);
    }
    image.channels[0].values[5] = std::numeric_limits<float>::quiet_NaN();
    image.channels[0].values[6] = -std::numeric_limits<float>::infinity();
    image.channels[0].values[7] = std::numeric_limits<float>::denorm_min();
    return image;
}

TEST(ImageExr, GivesBackEveryBitAndAttribute) {
    const TemporaryFolder folder;
    const std::string path = folder.file("picture.exr");
    ExrImage image = smallImage();
    image.attributes = {{"tesseraSource", std::string("mesh.vtu")},
                        {"tesseraSpacing", 0.1},
                        {"tesseraNormal", Vec3d(0.1, 1e-300, -3)}};
    writeExr(path, image, {});
    const ReadExr read = readExr(path);
    ASSERT_EQ(read.width, 37);
    ASSERT_EQ(read.height, 21);
    ASSERT_EQ(read.channels.size(), 4u);
    for (const ExrChannel& channel : image.channels)
        EXPECT_EQ(std::memcmp(read.channels.at(channel.name).data(), channel.values.data(),
                              channel.values.size() * sizeof(float)),
                  0)
            << channel.name;
    EXPECT_EQ(read.header.typedAttribute<Imf::StringAttribute>("tesseraSource").value(), "mesh.vtu");
    EXPECT_EQ(read.header.typedAttribute<Imf::DoubleAttribute>("tesseraSpacing").value(), 0.1);
    EXPECT_EQ(read.header.typedAttribute<Imf::V3dAttribute>("tesseraNormal").value(),
              Imath::V3d(0.1, 1e-300, -3));
}

// With layers Blender 3.4 takes a file for several pictures of no size.
TEST(ImageExr, NoFieldMakesALayer) {
    EXPECT_EQ(exrChannelNames("p", 1), std::vector<std::string>{"p"});
    EXPECT_EQ(exrChannelNames("U", 3), (std::vector<std::string>{"U_x", "U_y", "U_z"}));
    EXPECT_EQ(exrChannelNames("S", 6).back(), "S_5");
    const TemporaryFolder folder;
    const std::string path = folder.file("picture.exr");
    ExrImage image{2, 2, {}, {}, {}};
    for (const int components : {1, 2, 3, 6})
        for (const std::string& name : exrChannelNames("a.b." + std::to_string(components), components))
            image.channels.push_back({name, {1, 2, 3, 4}});
    writeExr(path, image, {});
    std::set<std::string> layers;
    readExr(path).header.channels().layers(layers);
    EXPECT_EQ(layers, std::set<std::string>{});
}

TEST(ImageExr, ShownChannelsAreWrittenAsRedGreenBlueAndAlphaToo) {
    const TemporaryFolder folder;
    const std::string path = folder.file("picture.exr");
    ExrImage image = smallImage();
    image.shown = {1, 0, kExrZeros, 3};
    writeExr(path, image, {});
    const ReadExr read = readExr(path);
    ASSERT_EQ(read.channels.size(), 8u);
    const auto bits = [](const std::vector<float>& values) {
        return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
    };
    EXPECT_EQ(bits(read.channels.at("R")), bits(image.channels[1].values));
    EXPECT_EQ(bits(read.channels.at("G")), bits(image.channels[0].values));
    EXPECT_EQ(read.channels.at("B"), std::vector<float>(37 * 21, 0.0f));
    EXPECT_EQ(bits(read.channels.at("A")), bits(image.channels[3].values));
    for (const ExrChannel& channel : image.channels)
        EXPECT_EQ(bits(read.channels.at(channel.name)), bits(channel.values)) << channel.name;
    image.channels[0].name = "G";
    EXPECT_THROW(writeExr(path, image, {}), InputError);
}

TEST(ImageExr, NamesThatViewersTakeForColoursAreTold) {
    for (const char* name :
         {"R", "G", "B", "A", "Number", "Er", "NUMBER", "Tag", "Ab", "0a", "Red", "AR", "BA"})
        EXPECT_EQ(isShownAsColour(name), std::string(name) != "Tag") << name;
    for (const char* name :
         {"", "p", "pressure", "U_x", "coverage", "Number_", "error", "Ta", "Rag", "Red_", "Y"})
        EXPECT_FALSE(isShownAsColour(name)) << name;
}

TEST(ImageExr, SamePictureGivesTheSameBytes) {
    const TemporaryFolder folder;
    writeExr(folder.file("a.exr"), smallImage(), {});
    writeExr(folder.file("b.exr"), smallImage(), {});
    EXPECT_EQ(bytesOf(folder.file("a.exr")), bytesOf(folder.file("b.exr")));
}

TEST(ImageExr, LongNamesAndNamesBeyondAsciiAreKept) {
    const TemporaryFolder folder;
    ExrImage image{2, 2, {}, {}, {}};
    for (const std::string& name : {std::string(200, 'n'), std::string("\xcf\x81 (kg/m3)")})
        image.channels.push_back({name, {1, 2, 3, 4}});
    writeExr(folder.file("names.exr"), image, {});
    const ReadExr read = readExr(folder.file("names.exr"));
    for (const ExrChannel& channel : image.channels)
        EXPECT_EQ(read.channels.at(channel.name), channel.values) << channel.name;
}

TEST(ImageExr, ClashingAndEmptyNamesAreRejected) {
    const TemporaryFolder folder;
    ExrImage image = smallImage();
    image.channels[1].name = "p";
    EXPECT_THROW(writeExr(folder.file("bad.exr"), image, {}), InputError);
    image.channels[1].name = "";
    EXPECT_THROW(writeExr(folder.file("bad.exr"), image, {}), InputError);
    image.channels[1].name = std::string(300, 'n');
    EXPECT_THROW(writeExr(folder.file("bad.exr"), image, {}), InputError);
    EXPECT_FALSE(std::filesystem::exists(folder.file("bad.exr")));
}

TEST(ImageExr, NothingIsLeftOfAFileThatCouldNotBeWritten) {
    const TemporaryFolder folder;
    EXPECT_THROW(writeExr(folder.file("nowhere/a.exr"), smallImage(), {}), IoError);
    std::atomic<bool> stop{true};
    Execution cancelled;
    cancelled.cancel = &stop;
    EXPECT_THROW(writeExr(folder.file("a.exr"), smallImage(), cancelled), Cancelled);

    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    rlimit small = before;
    small.rlim_cur = 2000;  // the header fits, the pixels don't
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    EXPECT_THROW(writeExr(folder.file("a.exr"), smallImage(), {}), IoError);
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    EXPECT_TRUE(std::filesystem::is_empty(std::filesystem::path(folder.file("a.exr")).parent_path()));
}

// From the mesh to the file: a linear field on an oblique plane, at the places that the header states.
TEST(ImageExr, CutOfALinearFieldHoldsItsValues) {
    TetMesh mesh = boxMesh({.cells = Vec3i(6), .jitter = 0.2});
    Field f{"f", FieldLocation::point, 1, {}}, v{"v", FieldLocation::point, 3, {}};
    for (const Vec3d& p : mesh.points) {
        f.values.push_back(1 + p.x + 2 * p.y - 3 * p.z);
        for (int k = 0; k < 3; ++k) v.values.push_back(2 * p[k] - 1);
    }
    mesh.fields = {f, v};
    CutOptions options;
    options.normal = {2, -1, 3};
    options.resolution = 150;
    const Cut cut = planCut(mesh, PlaneQuery(mesh), options);
    const CutSamples samples =
        sampleCut(mesh, cut, std::vector<int>{0, 1}, findResampler("software"), {}, {});
    ExrImage image{samples.width, samples.height, {}, {}, {}};
    image.channels.push_back({"coverage", {samples.coverage.begin(), samples.coverage.end()}});
    const std::vector<std::string> names{"f", "v.x", "v.y", "v.z"};
    for (std::size_t c = 0; c < names.size(); ++c) image.channels.push_back({names[c], samples.channels[c]});
    const Lattice& l = cut.frame.lattice;
    image.attributes = {{"tesseraOrigin", l.originWorld}, {"tesseraU", l.uWorld}, {"tesseraV", l.vWorld}};
    const TemporaryFolder folder;
    writeExr(folder.file("cut.exr"), image, {});

    const ReadExr read = readExr(folder.file("cut.exr"));
    const auto vector = [&](const char* name) {
        const Imath::V3d value = read.header.typedAttribute<Imf::V3dAttribute>(name).value();
        return Vec3d(value.x, value.y, value.z);
    };
    const Vec3d origin = vector("tesseraOrigin"), u = vector("tesseraU"), w = vector("tesseraV");
    std::int64_t covered = 0;
    for (int y = 0; y < read.height; ++y)
        for (int x = 0; x < read.width; ++x) {
            const std::size_t i = std::size_t(y) * std::size_t(read.width) + std::size_t(x);
            const Vec3d p = origin + double(x) * u + double(read.height - 1 - y) * w;
            EXPECT_NEAR(glm::dot(p - Vec3d(0.5), Vec3d(2, -1, 3)), 0, 1e-12);
            const double depth = std::min({p.x, p.y, p.z, 1 - p.x, 1 - p.y, 1 - p.z});
            if (std::abs(depth) > 1e-12) {
                EXPECT_EQ(read.channels.at("coverage")[i], depth > 0 ? 1.0f : 0.0f);
            }
            const bool inside = read.channels.at("coverage")[i] != 0;
            covered += inside;
            EXPECT_NEAR(read.channels.at("f")[i], inside ? 1 + p.x + 2 * p.y - 3 * p.z : 0, 4e-6);
            EXPECT_NEAR(read.channels.at("v.z")[i], inside ? 2 * p.z - 1 : 0, 2e-6);
        }
    EXPECT_GT(covered, read.width * read.height / 3);
}

}  // namespace
}  // namespace tessera
