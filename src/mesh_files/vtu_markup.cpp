#include "mesh_files/vtu_markup.h"

#include <algorithm>
#include <charconv>
#include <initializer_list>
#include <limits>
#include <map>
#include <set>
#include <string_view>

#include "base/text.h"

namespace tessera {

namespace {

constexpr std::size_t kMostMarkupBytes = 64 << 10;
constexpr std::int64_t kMostItems = std::numeric_limits<std::int32_t>::max();

struct Element {
    std::string name;
    std::map<std::string, std::string> attributes;
    std::vector<Element> children;

    const Element* child(std::string_view called) const {
        for (const Element& element : children)
            if (element.name == called) return &element;
        return nullptr;
    }
    std::string attribute(const std::string& called) const {
        const auto found = attributes.find(called);
        return found == attributes.end() ? std::string() : found->second;
    }
    /// Whether it has no others, and no child twice unless there may be several.
    bool hasOnly(std::initializer_list<std::string_view> attributeNames,
                 std::initializer_list<std::string_view> childNames) const {
        const auto isIn = [](const auto& list, const std::string& word) {
            return std::find(list.begin(), list.end(), word) != list.end();
        };
        std::set<std::string> seen;
        return std::all_of(attributes.begin(), attributes.end(),
                           [&](const auto& a) { return isIn(attributeNames, a.first); }) &&
               std::all_of(children.begin(), children.end(), [&](const Element& c) {
                   const bool mayBeSeveral =
                       c.name == "DataArray" || c.name == "InformationKey" || c.name == "Value";
                   return isIn(childNames, c.name) && (mayBeSeveral || seen.insert(c.name).second);
               });
    }
};

/// Takes elements off a text. After anything unexpected all fails.
class Parser {
  public:
    explicit Parser(std::string_view text) : rest_(text) {}

    void skipDeclaration() {
        for (const std::string_view known :
             {"<?xml version=\"1.0\"?>", "<?xml version='1.0'?>",
              "<?xml version=\"1.0\" encoding=\"UTF-8\"?>", "<?xml version=\"1.0\" encoding=\"utf-8\"?>"})
            if (take(known)) return;
    }
    void skipSpaces() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t\r\n"), rest_.size())); }
    bool take(std::string_view word) {
        if (!rest_.starts_with(word)) return false;
        rest_.remove_prefix(word.size());
        return true;
    }
    std::size_t left() const { return rest_.size(); }

    /// <name attributes>; `isEmpty` tells of one that ends in />.
    bool openTag(Element& element, bool& isEmpty) {
        if (!take("<")) return false;
        element.name = word();
        if (element.name.empty()) return false;
        while (true) {
            const std::size_t before = rest_.size();
            skipSpaces();
            const bool isApart = rest_.size() < before;
            isEmpty = take("/>");
            if (isEmpty || take(">")) return true;
            const std::string name = word();
            if (!isApart || name.empty() || !take("=")) return false;
            const char quote = rest_.empty() ? '\0' : rest_.front();
            if (quote != '"' && quote != '\'') return false;
            const std::size_t end = rest_.find(quote, 1);
            if (end == std::string_view::npos) return false;
            const std::string_view value = rest_.substr(1, end - 1);
            const bool isPlain = std::all_of(value.begin(), value.end(), [](char c) {
                return c >= ' ' && c <= '~' && c != '<' && c != '&';
            });
            if (!isPlain || !element.attributes.emplace(name, value).second) return false;
            rest_.remove_prefix(end + 1);
        }
    }
    /// An element with all that is in it: text only in a Value, and there only a number.
    bool element(Element& element, int depth = 0) {
        bool isEmpty = false;
        if (depth > 5 || !openTag(element, isEmpty)) return false;
        if (element.name == "Value" && !isEmpty) {
            skipSpaces();
            rest_.remove_prefix(std::min(rest_.find_first_not_of("0123456789+-.eE"), rest_.size()));
        }
        while (!isEmpty) {
            skipSpaces();
            if (take("</" + element.name + ">")) break;
            if (!this->element(element.children.emplace_back(), depth + 1)) return false;
        }
        return true;
    }

  private:
    std::string word() {
        std::size_t length = 0;
        while (length < rest_.size() &&
               ((rest_[length] >= 'a' && rest_[length] <= 'z') ||
                (rest_[length] >= 'A' && rest_[length] <= 'Z') || rest_[length] == '_' ||
                (length > 0 && rest_[length] >= '0' && rest_[length] <= '9')))
            ++length;
        const std::string taken(rest_.substr(0, length));
        rest_.remove_prefix(length);
        return taken;
    }
    std::string_view rest_;
};

std::optional<std::int64_t> numberIn(const std::string& text, std::int64_t least, std::int64_t most) {
    std::int64_t number = 0;
    const auto result = std::from_chars(text.data(), text.data() + text.size(), number);
    if (result.ec != std::errc() || result.ptr != text.data() + text.size()) return std::nullopt;
    return number >= least && number <= most ? std::optional(number) : std::nullopt;
}

/// What VTK notes of an array's values, and nobody reads here.
bool isRangeKey(const Element& element) {
    const std::string name = element.attribute("name");
    return element.name == "InformationKey" && element.hasOnly({"name", "location", "length"}, {"Value"}) &&
           (name == "L2_NORM_RANGE" || name == "L2_NORM_FINITE_RANGE") &&
           element.attribute("location") == "vtkDataArray" && element.attribute("length") == "2" &&
           element.children.size() == 2 && element.children[0].hasOnly({"index"}, {}) &&
           element.children[1].hasOnly({"index"}, {}) && element.children[0].attribute("index") == "0" &&
           element.children[1].attribute("index") == "1";
}

bool readArray(const Element& element, FieldLocation location, VtuArray& array) {
    if (!element.hasOnly({"type", "Name", "NumberOfComponents", "format", "offset", "RangeMin", "RangeMax"},
                         {"InformationKey"}) ||
        !std::all_of(element.children.begin(), element.children.end(), isRangeKey) ||
        element.attribute("format") != "appended")
        return false;
    const std::string componentText = element.attribute("NumberOfComponents");
    const auto components = numberIn(componentText.empty() ? "1" : componentText, 1, 9);
    const auto offset = numberIn(element.attribute("offset"), 0, std::numeric_limits<std::int64_t>::max());
    if (!components || !offset) return false;
    array = {element.attribute("Name"), element.attribute("type"), location, int(*components),
             std::size_t(*offset)};
    return true;
}

bool readFields(const Element* section, FieldLocation location, std::vector<VtuArray>& fields) {
    if (!section) return true;
    if (!section->hasOnly({"Scalars", "Vectors"}, {"DataArray"})) return false;
    std::set<std::string> names;
    for (const Element& element : section->children) {
        VtuArray& array = fields.emplace_back();
        // Names that begin so mean something to VTK.
        if (!readArray(element, location, array) || array.name.empty() || array.name.starts_with("vtk") ||
            plainName(array.name) != array.name || !names.insert(array.name).second)
            return false;
    }
    // VTK warns of vectors that aren't any.
    const std::string vectors = section->attribute("Vectors");
    return vectors.empty() || std::any_of(fields.begin(), fields.end(), [&](const VtuArray& array) {
               return array.location == location && array.name == vectors && array.components == 3;
           });
}

bool readPiece(const Element& piece, VtuMarkup& markup) {
    const auto points = numberIn(piece.attribute("NumberOfPoints"), 1, kMostItems);
    const auto cells = numberIn(piece.attribute("NumberOfCells"), 1, kMostItems / 4);
    const Element *coordinates = piece.child("Points"), *topology = piece.child("Cells");
    if (!piece.hasOnly({"NumberOfPoints", "NumberOfCells"}, {"PointData", "CellData", "Points", "Cells"}) ||
        !points || !cells || !coordinates || !topology || !coordinates->hasOnly({}, {"DataArray"}) ||
        !topology->hasOnly({}, {"DataArray"}) || coordinates->children.size() != 1 ||
        topology->children.size() != 3)
        return false;
    markup.points = *points;
    markup.cells = *cells;
    if (!readArray(coordinates->children[0], FieldLocation::point, markup.coordinates)) return false;
    std::set<std::string> seen;
    for (const Element& element : topology->children) {
        const std::string name = element.attribute("Name");
        VtuArray* array = name == "connectivity" ? &markup.connectivity
                          : name == "offsets"    ? &markup.offsets
                          : name == "types"      ? &markup.types
                                                 : nullptr;
        if (!array || !seen.insert(name).second || !readArray(element, FieldLocation::cell, *array) ||
            array->components != 1)
            return false;
    }
    return readFields(piece.child("PointData"), FieldLocation::point, markup.fields) &&
           readFields(piece.child("CellData"), FieldLocation::cell, markup.fields);
}

bool readRoot(const Element& root, VtuMarkup& markup) {
    const std::string header = root.attribute("header_type"), compressor = root.attribute("compressor");
    const std::string version = root.attribute("version");  // VTK warns of one that it doesn't know
    if (root.name != "VTKFile" ||
        !root.hasOnly({"type", "version", "byte_order", "header_type", "compressor"}, {}) ||
        !(version == "0.1" || version == "1.0" || version == "2.0" || version == "2.1" || version == "2.2") ||
        root.attribute("type") != "UnstructuredGrid" || root.attribute("byte_order") != "LittleEndian" ||
        !(header.empty() || header == "UInt32" || header == "UInt64") ||
        !(compressor.empty() || compressor == "vtkZLibDataCompressor"))
        return false;
    markup.headerBytes = header == "UInt64" ? 8 : 4;
    markup.compressed = !compressor.empty();
    return true;
}

}  // namespace

std::optional<VtuMarkup> parsePlainVtu(InputFile& file) {
    const std::string text = file.copy(0, kMostMarkupBytes);
    Parser parser(text);
    VtuMarkup markup;
    Element root, grid, appended;
    bool isEmpty = false;
    parser.skipDeclaration();
    parser.skipSpaces();
    if (!parser.openTag(root, isEmpty) || isEmpty || !readRoot(root, markup)) return std::nullopt;
    parser.skipSpaces();
    if (!parser.element(grid) || grid.name != "UnstructuredGrid" || !grid.hasOnly({}, {"Piece"}) ||
        grid.children.size() != 1 || !readPiece(grid.children[0], markup))
        return std::nullopt;
    parser.skipSpaces();
    if (!parser.openTag(appended, isEmpty) || isEmpty || appended.name != "AppendedData" ||
        !appended.hasOnly({"encoding"}, {}) || appended.attribute("encoding") != "raw")
        return std::nullopt;
    parser.skipSpaces();
    if (!parser.take("_")) return std::nullopt;
    markup.appendedAt = text.size() - parser.left();
    markup.appendedEnd = std::max(markup.appendedAt, std::min(file.rfind("</AppendedData"), file.size()));
    return markup;
}

}  // namespace tessera
