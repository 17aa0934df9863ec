#include "pictures/image_exr.h"

#include <ImathBox.h>
#include <ImathVec.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>

#include <algorithm>
#include <array>
#include <set>

#include "base/check.h"
#include "files/atomic_file.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kLongestName = 255;  // the format's own bound
constexpr int kRowsAtOnce = 16;            // what is compressed together
constexpr std::array kShownNames{"R", "G", "B", "A"};

/// OpenEXR's output side over an AtomicFile.
class AtomicExrStream : public Imf::OStream {
  public:
    explicit AtomicExrStream(AtomicFile& file) : Imf::OStream(file.path().c_str()), file_(file) {}
    void write(const char bytes[], int count) override {
        file_.writeAt(position_, bytes, std::size_t(count));
        position_ += count;
    }
    std::uint64_t tellp() override { return std::uint64_t(position_); }
    void seekp(std::uint64_t position) override { position_ = std::int64_t(position); }

  private:
    AtomicFile& file_;
    std::int64_t position_ = 0;
};

void checkImage(const ExrImage& image) {
    const std::size_t pixels = std::size_t(image.width) * std::size_t(image.height);
    TESSERA_CHECK(image.width > 0 && image.height > 0, "a picture has pixels");
    TESSERA_CHECK(image.shown.empty() || image.shown.size() == kShownNames.size(),
                  "four channels are shown, or none");
    std::set<std::string> names;
    if (!image.shown.empty()) names.insert(kShownNames.begin(), kShownNames.end());
    for (const ExrChannel& channel : image.channels) {
        TESSERA_CHECK(channel.values.size() == pixels, "a channel has a value for every pixel");
        if (channel.name.empty() || channel.name.size() > kLongestName ||
            channel.name.find('\0') != std::string::npos)
            throw InputError("an EXR channel's name has 1 to " + std::to_string(kLongestName) +
                             " bytes, got '" + channel.name + "'");
        if (!names.insert(channel.name).second)
            throw InputError("two EXR channels would have the name '" + channel.name + "'");
    }
}

void addAttribute(Imf::Header& header, const ExrAttribute& attribute) {
    const auto& [name, value] = attribute;
    if (const auto* text = std::get_if<std::string>(&value))
        header.insert(name, Imf::StringAttribute(*text));
    else if (const auto* number = std::get_if<double>(&value))
        header.insert(name, Imf::DoubleAttribute(*number));
    else if (const auto* v = std::get_if<Vec3d>(&value))
        header.insert(name, Imf::V3dAttribute(Imath::V3d(v->x, v->y, v->z)));
}

}  // namespace

std::vector<std::string> exrChannelNames(const std::string& field, int components) {
    std::string base = field;
    std::replace(base.begin(), base.end(), '.', '_');
    if (components == 1) return {base};
    std::vector<std::string> names;
    for (int c = 0; c < components; ++c)
        names.push_back(base + '_' + (components <= 3 ? std::string(1, "xyz"[c]) : std::to_string(c)));
    return names;
}

bool isShownAsColour(const std::string& channel) {
    for (const char* name : {"Red", "Green", "Blue", "AR", "RA", "AG", "GA", "AB", "BA"})
        if (channel == name) return true;
    if (channel.empty()) return false;
    const char last = char(std::toupper(static_cast<unsigned char>(channel.back())));
    // Channels stand in the order of their names.
    return std::string("RGBA").find(last) != std::string::npos && channel <= std::string(1, last);
}

void writeExr(const std::string& path, const ExrImage& image, const Execution& execution) {
    checkImage(image);
    AtomicFile file(path);
    try {
        Imf::Header header(image.width, image.height);
        header.compression() = Imf::ZIP_COMPRESSION;
        for (const ExrAttribute& attribute : image.attributes) addAttribute(header, attribute);
        Imf::FrameBuffer pixels;
        const auto add = [&](const std::string& name, const ExrChannel& channel) {
            header.channels().insert(name, Imf::Channel(Imf::FLOAT));
            // The library's slices are read from here on, whatever their type says.
            char* values = const_cast<char*>(reinterpret_cast<const char*>(channel.values.data()));
            pixels.insert(name, Imf::Slice(Imf::FLOAT, values, sizeof(float),
                                           sizeof(float) * std::size_t(image.width)));
        };
        for (const ExrChannel& channel : image.channels) add(channel.name, channel);
        for (std::size_t c = 0; c < image.shown.size(); ++c) {
            if (image.shown[c] != kExrZeros)
                add(kShownNames[c], image.channels.at(std::size_t(image.shown[c])));
            else  // the library writes zeros for a channel without pixels
                header.channels().insert(kShownNames[c], Imf::Channel(Imf::FLOAT));
        }
        AtomicExrStream stream(file);
        Imf::OutputFile output(stream, header);
        output.setFrameBuffer(pixels);
        for (int y = 0; y < image.height; y += kRowsAtOnce) {
            execution.throwIfCancelled();
            execution.report(Stage::writing, y, image.height);
            output.writePixels(std::min(kRowsAtOnce, image.height - y));
        }
    } catch (const Iex::BaseExc& error) {
        throw IoError("can't write " + path + ": " + error.what());
    }
    file.commit();
}

}  // namespace tessera
