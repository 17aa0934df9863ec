#include "mesh_files/xml_arrays.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <vector>

#include "tessera/error.h"

namespace tessera {

namespace {

// The most bytes that a packed one can hold: deflate's best is 1032, and there are headers.
constexpr double kDeflateRatio = 1040, kLz4Ratio = 256;

int base64Value(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
}

/// Up to `most` bytes from the start of base64 text.
std::vector<unsigned char> decodeBase64(std::string_view text, std::size_t most) {
    std::vector<unsigned char> bytes;
    unsigned bits = 0;
    int count = 0;
    for (const char c : text) {
        const int value = base64Value(c);
        if (value < 0 || bytes.size() >= most) break;
        bits = (bits << 6 | unsigned(value)) & 0xffffff;
        if ((count += 6) >= 8) bytes.push_back(static_cast<unsigned char>(bits >> (count -= 8)));
    }
    return bytes;
}

std::uint64_t readSize(const unsigned char* bytes, const XmlPacking& packing) {
    std::uint64_t value = 0;
    for (int i = 0; i < packing.headerBytes; ++i)
        value = value << 8 | bytes[packing.bigEndian ? i : packing.headerBytes - 1 - i];
    return value;
}

/// Where an array's values are, its header included.
struct PackedPlace {
    std::size_t begin = 0, end = 0;
    bool base64 = false;
};

class PackedArray {
  public:
    PackedArray(InputFile& file, const XmlTag& tag, const XmlPacking& packing, const PackedPlace& place)
        : path_(file.path()), tag_(tag), packing_(packing), place_(place) {
        const std::size_t bytes = place.end - place.begin;
        // Three characters of every four hold bytes.
        room_ = place.base64 ? double(bytes) * 0.75 : double(bytes);
        const std::size_t most = 3 * std::size_t(packing.headerBytes);
        const std::string_view stored =
            file.bytesFrom(place.begin, 2 * most).substr(0, std::min(bytes, 2 * most));
        head_ = place.base64
                    ? decodeBase64(stored, most)
                    : std::vector<unsigned char>(
                          stored.begin(), stored.begin() + std::ptrdiff_t(std::min(most, stored.size())));
    }

    void check() const {
        const auto words = head_.size() / std::size_t(packing_.headerBytes);
        if (words < 1) fail("ends before its size");
        const double first = double(word(0));
        if (!packing_.compressed) {
            if (first + packing_.headerBytes > room_) fail("declares " + countText(word(0)) + " bytes");
            return;
        }
        if (word(0) == 0) return;
        if (words < 3) fail("ends before its sizes");
        if ((first + 3) * packing_.headerBytes > room_) fail("declares " + countText(word(0)) + " blocks");
        const double unpacked = (first - (word(2) > 0)) * double(word(1)) + double(word(2));
        if (word(2) > word(1) || (packing_.largestRatio && unpacked > room_ * *packing_.largestRatio))
            fail("declares " + countText(word(0)) + " blocks of " + countText(word(1)) + " bytes unpacked");
    }

  private:
    std::uint64_t word(int index) const {
        return readSize(head_.data() + index * packing_.headerBytes, packing_);
    }
    static std::string countText(std::uint64_t count) { return std::to_string(count); }
    [[noreturn]] void fail(const std::string& what) const {
        throw InputError(path_ + ": damaged: byte " + std::to_string(place_.begin) + ": array " +
                         quoted(attributeOf(tag_.text, "Name").value_or("")) + " " + what + ", and " +
                         std::to_string(place_.end - place_.begin) + " follow in the file");
    }

    const std::string& path_;
    const XmlTag& tag_;
    const XmlPacking& packing_;
    PackedPlace place_;
    double room_ = 0;
    std::vector<unsigned char> head_;
};

}  // namespace

XmlPacking packingOf(InputFile& file, std::string_view root, std::size_t appendedTag) {
    XmlPacking packing;
    packing.headerBytes = attributeOf(root, "header_type") == "UInt64" ? 8 : 4;
    packing.bigEndian = attributeOf(root, "byte_order") == "BigEndian";
    const std::string_view compressor = attributeOf(root, "compressor").value_or("");
    packing.compressed = !compressor.empty();
    if (compressor == "vtkZLibDataCompressor")
        packing.largestRatio = kDeflateRatio;
    else if (compressor == "vtkLZ4DataCompressor")
        packing.largestRatio = kLz4Ratio;
    else if (packing.compressed)
        packing.largestRatio = std::nullopt;
    if (appendedTag == InputFile::npos) return packing;
    XmlTags tags(file, appendedTag, file.size());
    const auto tag = tags.next();
    if (!tag) return packing;
    packing.appendedIsBase64 = attributeOf(tag->text, "encoding") != "raw";
    const std::size_t mark = file.find("_", tag->end);
    if (mark == InputFile::npos) return packing;
    packing.appendedAt = mark + 1;
    packing.appendedEnd = std::max(mark + 1, std::min(file.rfind("</AppendedData"), file.size()));
    return packing;
}

void checkPackedArray(InputFile& file, const XmlTag& tag, const XmlPacking& packing) {
    const std::string_view format = attributeOf(tag.text, "format").value_or("");
    PackedPlace place{tag.end, tag.end, true};
    if (format == "binary") {
        place.begin = std::min(file.findFirstNotOf(" \t\r\n", tag.end), file.size());
        place.end = std::min(file.find("<", place.begin), file.size());
        if (place.begin == place.end) return;  // no values at all
    } else if (format == "appended" && packing.appendedAt) {
        const auto offsetText = attributeOf(tag.text, "offset");
        if (!offsetText) return;
        std::uint64_t offset = 0;
        const auto result =
            std::from_chars(offsetText->data(), offsetText->data() + offsetText->size(), offset);
        const std::uint64_t room = packing.appendedEnd - *packing.appendedAt;
        if (result.ec != std::errc() || offset >= room)
            throw InputError(file.path() + ": damaged or cut off: byte " + std::to_string(tag.begin) +
                             ": an array's offset is " + quoted(*offsetText) + ", there are " +
                             std::to_string(room) + " bytes of appended data");
        place = {*packing.appendedAt + offset, packing.appendedEnd, packing.appendedIsBase64};
    } else {
        return;
    }
    PackedArray(file, tag, packing, place).check();
}

}  // namespace tessera
