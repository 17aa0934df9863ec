#include "mesh_files/read_ply.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <map>

#include "base/text.h"

namespace tessera {

namespace {

enum class Number { int8, uint8, int16, uint16, int32, uint32, float32, float64 };
constexpr std::array<std::size_t, 8> kBytes{1, 1, 2, 2, 4, 4, 4, 8};

struct Property {
    std::string name;
    Number type = Number::float32;
    bool isList = false;
    Number countType = Number::uint8;
};

struct Element {
    std::string name;
    std::int64_t count = 0;
    std::vector<Property> properties;
};

Number typeOf(NumberLines& lines, std::string_view word) {
    static const std::map<std::string_view, Number> kNumbers{
        {"char", Number::int8},      {"int8", Number::int8},       {"uchar", Number::uint8},
        {"uint8", Number::uint8},    {"short", Number::int16},     {"int16", Number::int16},
        {"ushort", Number::uint16},  {"uint16", Number::uint16},   {"int", Number::int32},
        {"int32", Number::int32},    {"uint", Number::uint32},     {"uint32", Number::uint32},
        {"float", Number::float32},  {"float32", Number::float32}, {"double", Number::float64},
        {"float64", Number::float64}};
    const auto found = kNumbers.find(word);
    if (found == kNumbers.end()) lines.fail("unknown type of number '" + printable(word.substr(0, 24)) + "'");
    return found->second;
}

class PlyReader {
  public:
    explicit PlyReader(const NamedText& text) : text_(text) { raw_.format = "PLY"; }
    RawSurface read();

  private:
    void readHead();
    void readElement(const Element& element);
    void readVertices(const Element& element);
    void readFaces(const Element& element);
    std::vector<double> readItem(const Element& element, std::vector<double>* corners);
    double readNumber(Number type, const Element& element);
    std::int64_t listLength(const Property& property, const Element& element);
    [[noreturn]] void fail(const std::string& why) const {
        throw InputError(text_.name + ": byte " + std::to_string(at_) + ": " + why);
    }

    const NamedText& text_;
    RawSurface raw_;
    std::vector<Element> elements_;
    bool isText_ = true, isSwapped_ = false;
    std::size_t at_ = 0;
};

void PlyReader::readHead() {
    constexpr std::string_view kEnd = "\nend_header";
    if (!text_.bytes.starts_with("ply"))
        throw InputError(text_.name + ": isn't a .ply file: it doesn't begin with ply");
    const std::size_t end = text_.bytes.find(kEnd);  // not within a comment: with the line's end before it
    const std::size_t line = end == std::string_view::npos ? end : text_.bytes.find('\n', end + 1);
    if (line == std::string_view::npos)
        throw InputError(text_.name + ": cut off inside its head: there is no end_header");
    at_ = line + 1;
    NumberLines lines({text_.name, text_.bytes.substr(0, end)});
    std::string format;
    while (lines.tryNext()) {
        const std::string_view keyword = lines.word();
        if (keyword == "format") {
            format = lines.word();
        } else if (keyword == "element") {
            Element& element = elements_.emplace_back();
            element.name = lines.word();
            element.count = lines.read<std::int64_t>("a number of elements");
            if (element.count < 0 || element.count > std::int64_t(text_.bytes.size()))
                lines.fail("declares " + std::to_string(element.count) + " elements, the file has " +
                           std::to_string(text_.bytes.size()) + " bytes");
        } else if (keyword == "property") {
            if (elements_.empty()) lines.fail("a property stands before any element");
            Property property;
            std::string_view type = lines.word();
            property.isList = type == "list";
            if (property.isList) {
                property.countType = typeOf(lines, lines.word());
                type = lines.word();
            }
            property.type = typeOf(lines, type);
            property.name = plainName(std::string(lines.word()));
            elements_.back().properties.push_back(std::move(property));
        }
    }
    isText_ = format == "ascii";
    if (!isText_ && format != "binary_little_endian" && format != "binary_big_endian")
        throw InputError(text_.name + ": format is '" + printable(format.substr(0, 24)) +
                         "', expected ascii, binary_little_endian or binary_big_endian");
    isSwapped_ = (format == "binary_big_endian") != (std::endian::native == std::endian::big);
}

double PlyReader::readNumber(Number type, const Element& element) {
    const std::string_view bytes = text_.bytes;
    const auto cutOff = [&] { fail("cut off inside '" + printable(element.name.substr(0, 24)) + "'"); };
    if (isText_) {
        constexpr std::string_view kBlanks = " \t\r\n";
        at_ = std::min(bytes.find_first_not_of(kBlanks, at_), bytes.size());
        const std::size_t end = std::min(bytes.find_first_of(kBlanks, at_), bytes.size());
        const std::string_view word = bytes.substr(at_, end - at_);
        if (word.empty()) cutOff();
        const std::optional<double> number = numberOf<double>(word);
        if (!number) fail("expected a number, found '" + printable(word.substr(0, 24)) + "'");
        at_ = end;
        return *number;
    }
    const std::size_t size = kBytes[std::size_t(type)];
    if (bytes.size() - at_ < size) cutOff();
    std::array<char, 8> item{};
    std::copy_n(bytes.data() + at_, size, item.begin());
    if (isSwapped_) std::reverse(item.begin(), item.begin() + std::ptrdiff_t(size));
    at_ += size;
    const auto as = [&](auto value) {
        std::memcpy(&value, item.data(), sizeof value);
        return double(value);
    };
    switch (type) {
        case Number::int8:
            return as(std::int8_t());
        case Number::uint8:
            return as(std::uint8_t());
        case Number::int16:
            return as(std::int16_t());
        case Number::uint16:
            return as(std::uint16_t());
        case Number::int32:
            return as(std::int32_t());
        case Number::uint32:
            return as(std::uint32_t());
        case Number::float32:
            return as(float());
        case Number::float64:
            break;
    }
    return as(double());
}

std::int64_t PlyReader::listLength(const Property& property, const Element& element) {
    const double length = readNumber(property.countType, element);
    if (!(length >= 0 && length <= double(text_.bytes.size() - at_) + 1))
        fail("a list of " + exactText(length) + " numbers is more than the file holds");
    return std::int64_t(length);
}

/// The numbers of one item. @param corners gets the list of a face's corners; other lists are left out.
std::vector<double> PlyReader::readItem(const Element& element, std::vector<double>* corners) {
    std::vector<double> numbers;
    for (const Property& property : element.properties) {
        if (!property.isList) {
            numbers.push_back(readNumber(property.type, element));
            continue;
        }
        const bool areCorners =
            corners && (property.name == "vertex_indices" || property.name == "vertex_index");
        for (std::int64_t i = listLength(property, element); i > 0; --i) {
            const double number = readNumber(property.type, element);
            if (areCorners) corners->push_back(number);
        }
    }
    return numbers;
}

/// Where numbers of an item go.
struct Target {
    std::size_t field = 0;
    int component = 0;  ///< -1: a coordinate, the field's number of it
};

/// Fields for the numbers of an element: those that belong together are one.
std::vector<Target> makeFields(const Element& element, FieldLocation location, std::vector<Field>& fields) {
    static const std::map<std::string, std::pair<std::string, int>> kParts{
        {"red", {"color", 0}}, {"green", {"color", 1}}, {"blue", {"color", 2}}, {"alpha", {"color", 3}},
        {"nx", {"normal", 0}}, {"ny", {"normal", 1}},   {"nz", {"normal", 2}}};
    const auto isThere = [&](const std::string& name) {
        return std::any_of(element.properties.begin(), element.properties.end(),
                           [&](const Property& p) { return !p.isList && p.name == name; });
    };
    const bool isColored = isThere("red") && isThere("green") && isThere("blue");
    const bool hasNormals = isThere("nx") && isThere("ny") && isThere("nz");
    const std::string coordinates = "xyz";
    std::map<std::string, std::size_t> known;
    std::vector<Target> targets;
    for (const Property& property : element.properties) {
        if (property.isList) continue;
        if (location == FieldLocation::point && property.name.size() == 1 &&
            coordinates.find(property.name) != std::string::npos) {
            targets.push_back({coordinates.find(property.name), -1});
            continue;
        }
        std::string name = property.name.empty() ? "property" : property.name;
        const auto part = kParts.find(name);
        if (part != kParts.end() && (part->second.first == "color" ? isColored : hasNormals))
            name = part->second.first;
        const auto [at, isNew] = known.emplace(name, fields.size());
        if (isNew) fields.push_back({name, location, 0, {}});
        targets.push_back({at->second, fields[at->second].components++});
    }
    return targets;
}

void PlyReader::readVertices(const Element& element) {
    std::vector<Field> fields;
    const std::vector<Target> targets = makeFields(element, FieldLocation::point, fields);
    std::array<int, 3> found{};
    for (const Target& target : targets)
        if (target.component < 0) ++found[target.field];
    if (found != std::array{1, 1, 1}) fail("points need x, y and z");
    for (std::int64_t v = 0; v < element.count; ++v) {
        const std::vector<double> numbers = readItem(element, nullptr);
        Vec3d& place = raw_.points.emplace_back(0.0);
        for (std::size_t i = 0; i < targets.size(); ++i) {
            if (targets[i].component < 0)
                place[int(targets[i].field)] = numbers[i];
            else
                fields[targets[i].field].values.push_back(numbers[i]);
        }
    }
    std::erase_if(fields, [](const Field& field) { return field.components > 9; });
    raw_.fields.insert(raw_.fields.end(), fields.begin(), fields.end());
}

void PlyReader::readFaces(const Element& element) {
    std::vector<Field> fields;
    const std::vector<Target> targets = makeFields(element, FieldLocation::cell, fields);
    for (std::int64_t f = 0; f < element.count; ++f) {
        std::vector<double> corners;
        const std::vector<double> numbers = readItem(element, &corners);
        if (corners.size() < 3)
            fail("face " + std::to_string(f) + " has " + std::to_string(corners.size()) +
                 " corners, expected 3 or more");
        for (const double corner : corners) {
            if (!(corner >= 0 && corner < double(raw_.points.size())) ||
                corner != double(std::int64_t(corner)))
                fail("face " + std::to_string(f) + " names point " + exactText(corner) +
                     ", out of range 0 to " + std::to_string(std::int64_t(raw_.points.size()) - 1));
            raw_.corners.push_back(std::int32_t(corner));
        }
        raw_.endPolygon();
        for (std::size_t i = 0; i < targets.size(); ++i)
            fields[targets[i].field].values.push_back(numbers[i]);
    }
    std::erase_if(fields, [](const Field& field) { return field.components > 9; });
    raw_.fields.insert(raw_.fields.end(), fields.begin(), fields.end());
}

RawSurface PlyReader::read() {
    readHead();
    bool hasPoints = false, hasFaces = false;
    for (const Element& element : elements_) {
        if (element.name == "vertex" && !hasPoints) {
            hasPoints = true;
            readVertices(element);
        } else if (element.name == "face" && !hasFaces) {
            hasFaces = true;
            readFaces(element);
        } else {
            if (element.name == "tristrips" && element.count > 0)
                throw InputError(text_.name +
                                 ": strips of triangles (element 'tristrips') aren't read, faces are");
            const std::int64_t items = element.properties.empty() ? 0 : element.count;
            for (std::int64_t i = 0; i < items; ++i) readItem(element, nullptr);
        }
    }
    if (!hasPoints) throw InputError(text_.name + ": has no element 'vertex'");
    return std::move(raw_);
}

}  // namespace

RawSurface readPly(const NamedText& text) {
    return PlyReader(text).read();
}

}  // namespace tessera
