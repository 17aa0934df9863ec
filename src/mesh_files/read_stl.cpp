#include "mesh_files/read_stl.h"

#include <cstdint>
#include <cstring>

#include "base/text.h"

namespace tessera {

namespace {

constexpr std::size_t kHeadBytes = 84, kTriangleBytes = 50;  // of binary files

std::uint32_t declaredTriangles(std::string_view bytes) {
    std::uint32_t count = 0;
    std::memcpy(&count, bytes.data() + kHeadBytes - sizeof count, sizeof count);
    return count;
}

void addTriangle(RawSurface& raw) {
    for (std::size_t i = 3; i > 0; --i) raw.corners.push_back(std::int32_t(raw.points.size() - i));
    raw.endPolygon();
}

void readBinary(const NamedText& text, RawSurface& raw) {
    const char* next = text.bytes.data() + kHeadBytes;
    for (std::uint32_t t = declaredTriangles(text.bytes); t > 0; --t, next += kTriangleBytes) {
        float numbers[12];  // the normal, which the corners tell as well, and three corners
        std::memcpy(numbers, next, sizeof numbers);
        for (int corner = 1; corner < 4; ++corner)
            raw.points.emplace_back(numbers[3 * corner], numbers[3 * corner + 1], numbers[3 * corner + 2]);
        addTriangle(raw);
    }
}

void readText(const NamedText& text, RawSurface& raw) {
    NumberLines lines(text, kOnlyBlanks);
    int corners = 0;
    bool isInFacet = false, isEnded = false;
    while (lines.tryNext()) {
        const std::string keyword = lowerCase(lines.word());
        if (keyword == "facet") {
            if (isInFacet) lines.fail("a facet begins within another");
            isInFacet = true;
            corners = 0;
        } else if (keyword == "vertex") {
            if (!isInFacet) lines.fail("a vertex stands outside of any facet");
            if (++corners > 3) lines.fail("a facet has more than 3 corners");
            Vec3d place{0};
            for (int k = 0; k < 3; ++k) place[k] = lines.read<double>("a coordinate");
            if (!lines.atEnd()) lines.fail("a vertex has more than 3 coordinates");
            raw.points.push_back(place);
        } else if (keyword == "endfacet") {
            if (corners != 3) lines.fail("a facet has " + std::to_string(corners) + " corners, expected 3");
            addTriangle(raw);
            isInFacet = false;
        }
        isEnded = keyword == "endsolid";
    }
    if (!isEnded) throw InputError(text.name + ": cut off: its last line isn't endsolid");
}

bool isText(std::string_view bytes) {
    if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);
    bytes.remove_prefix(std::min(bytes.find_first_not_of(" \t\r\n"), bytes.size()));
    return lowerCase(bytes.substr(0, 5)) == "solid";
}

}  // namespace

RawSurface readStl(const NamedText& text) {
    RawSurface raw;
    raw.format = kStlFormat;
    const std::size_t size = text.bytes.size();
    // Binary files may begin with "solid" too: their size tells.
    const std::uint64_t declared = size >= kHeadBytes ? declaredTriangles(text.bytes) : 0;
    if (size >= kHeadBytes && kHeadBytes + declared * kTriangleBytes == size)
        readBinary(text, raw);
    else if (isText(text.bytes))
        readText(text, raw);
    else if (size < kHeadBytes)
        throw InputError(text.name + ": isn't an .stl file, or cut off: it has " + std::to_string(size) +
                         " bytes");
    else
        throw InputError(text.name + ": damaged or cut off: it declares " + std::to_string(declared) +
                         " triangles, which take " + std::to_string(kHeadBytes + declared * kTriangleBytes) +
                         " bytes, and has " + std::to_string(size));
    return raw;
}

}  // namespace tessera
