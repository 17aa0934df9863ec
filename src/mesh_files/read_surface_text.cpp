#include "mesh_files/read_surface_text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "base/text.h"
#include "mesh_files/read_tetgen.h"
#include "mesh_files/triangulate.h"

namespace tessera {

namespace {

constexpr std::int64_t kMostCorners = 100000;  // of one polygon

Vec3d readPlace(NumberLines& lines) {
    Vec3d place{0};
    for (int k = 0; k < 3; ++k) place[k] = lines.read<double>("a coordinate");
    return place;
}

/// @param first of the file's indices.
std::int32_t readIndex(NumberLines& lines, std::int64_t first, std::size_t points) {
    const auto index = lines.read<std::int64_t>("the index of a point");
    if (index < first || index - first >= std::int64_t(points))
        lines.fail("point " + std::to_string(index) + " is out of range " + std::to_string(first) + " to " +
                   std::to_string(first + std::int64_t(points) - 1));
    return std::int32_t(index - first);
}

/// Of "5", "5/2", "5//7" or "-1/...": from 0.
std::int32_t objIndex(const NumberLines& lines, std::string_view corner, std::size_t points) {
    const auto index = numberOf<std::int64_t>(corner.substr(0, corner.find('/')));
    if (!index) lines.fail("expected the index of a point, found '" + printable(corner.substr(0, 24)) + "'");
    const std::int64_t place = *index < 0 ? std::int64_t(points) + *index : *index - 1;
    if (place < 0 || place >= std::int64_t(points))
        lines.fail("point " + std::to_string(*index) + " is none of the " + std::to_string(points) +
                   " before this line");
    return std::int32_t(place);
}

/// One facet: polygons with a plane, holes in which they count double.
void readFacet(NumberLines& lines, std::int64_t firstNode, RawSurface& raw) {
    lines.next("a facet");
    const std::int64_t polygons = lines.readCount("number of polygons", 2);
    const auto holes = lines.atEnd() ? 0 : lines.read<std::int64_t>("number of holes");
    if (polygons < 1 || holes < 0) lines.fail("a facet needs a polygon");
    std::vector<std::vector<std::int32_t>> loops;
    for (std::int64_t p = 0; p < polygons; ++p) {
        lines.next("a polygon");
        const std::int64_t corners = lines.readCount("number of corners", 2);
        if (corners < 3)
            lines.fail("a polygon of " + std::to_string(corners) +
                       " corners; points and segments within facets are not read, every polygon needs 3");
        if (corners > kMostCorners) lines.fail("a polygon of " + std::to_string(corners) + " corners");
        std::vector<std::int32_t>& loop = loops.emplace_back();
        for (std::int64_t c = 0; c < corners; ++c) {
            if (lines.atEnd()) lines.next("the index of a point");  // long polygons take several lines
            loop.push_back(readIndex(lines, firstNode, raw.points.size()));
        }
    }
    if (polygons > 1 && holes != polygons - 1)
        lines.fail("a facet of " + std::to_string(polygons) + " polygons and " + std::to_string(holes) +
                   " holes: only facets are read whose polygons but one are the rims of holes");
    for (std::int64_t h = 0; h < holes; ++h) lines.next("a hole of a facet");  // the polygons tell where
    if (loops.size() == 1) {
        raw.corners.insert(raw.corners.end(), loops[0].begin(), loops[0].end());
        return raw.endPolygon();
    }
    const auto triangles = trianglesOfFacet(raw.points, loops);
    if (triangles.empty()) lines.fail("the facet that ends here can't be split into triangles");
    for (const auto& triangle : triangles) {
        raw.corners.insert(raw.corners.end(), triangle.begin(), triangle.end());
        raw.endPolygon();
    }
}

void takeNodes(RawBlock nodes, RawSurface& raw) {
    raw.points = std::move(nodes.points);
    raw.fields = std::move(nodes.fields);
}

}  // namespace

RawSurface readOff(const NamedText& text) {
    RawSurface raw;
    raw.format = "OFF";
    NumberLines lines(text, kOnlyBlanks);
    lines.next("OFF");
    if (const std::string_view magic = lines.word(); lowerCase(magic) != "off")
        lines.fail("expected OFF, found '" + printable(magic.substr(0, 24)) +
                   "' (of its kinds only the plain one is read, in text)");
    if (lines.atEnd()) lines.next("numbers of points and faces");
    const std::int64_t points = lines.readCount("number of points", 6);
    const std::int64_t faces = lines.readCount("number of faces", 4);
    for (std::int64_t p = 0; p < points; ++p) {
        lines.next("a point");
        raw.points.push_back(readPlace(lines));
    }
    for (std::int64_t f = 0; f < faces; ++f) {
        lines.next("a face");
        const auto corners = lines.read<std::int64_t>("number of corners");
        if (corners < 3 || corners > kMostCorners)
            lines.fail("a face of " + std::to_string(corners) + " corners, expected 3 or more");
        for (std::int64_t c = 0; c < corners; ++c)
            raw.corners.push_back(readIndex(lines, 0, raw.points.size()));
        raw.endPolygon();
    }
    return raw;
}

RawSurface readObj(const NamedText& text) {
    RawSurface raw;
    raw.format = "Wavefront OBJ";
    Field color{"color", FieldLocation::point, 3, {}};
    bool hasCurves = false;
    NumberLines lines(text, kOnlyBlanks);
    while (lines.tryNext()) {
        const std::string_view keyword = lines.word();
        if (keyword == "v") {
            raw.points.push_back(readPlace(lines));
            std::vector<double> more;
            while (!lines.atEnd() && more.size() < 4) more.push_back(lines.read<double>("a number"));
            if (more.size() == 3) color.values.insert(color.values.end(), more.begin(), more.end());
        } else if (keyword == "f") {
            std::int64_t corners = 0;
            for (; !lines.atEnd(); ++corners)
                raw.corners.push_back(objIndex(lines, lines.word(), raw.points.size()));
            if (corners < 3 || corners > kMostCorners)
                lines.fail("a face of " + std::to_string(corners) + " corners, expected 3 or more");
            raw.endPolygon();
        } else {
            hasCurves |= keyword == "l" || keyword == "curv" || keyword == "surf";
        }
    }
    if (raw.ends.empty() && hasCurves)
        throw InputError(text.name + ": holds lines or curves and no faces; only faces are read");
    if (raw.points.empty())
        throw InputError(text.name + ": isn't an .obj file with points: no line begins with v");
    if (color.values.size() == 3 * raw.points.size()) raw.fields.push_back(std::move(color));
    return raw;
}

RawSurface readNodePoints(const NamedText& text) {
    RawSurface raw;
    raw.format = "TetGen points";
    NumberLines lines(text);
    RawBlock nodes;
    if (!readTetgenNodes(lines, nodes)) lines.fail("there are 0 points");
    takeNodes(std::move(nodes), raw);
    return raw;
}

RawSurface readPoly(const NamedText& text, const std::string& nodesPath,
                    const std::function<std::string()>& readNodes) {
    RawSurface raw;
    raw.format = kPolyFormat;
    NumberLines lines(text);
    RawBlock nodes;
    std::optional<std::int64_t> firstNode = readTetgenNodes(lines, nodes);
    if (!firstNode) {  // they stand in a file of their own
        const std::string other = readNodes();
        NumberLines nodeLines(NamedText{nodesPath, other});
        firstNode = readTetgenNodes(nodeLines, nodes);
        if (!firstNode) nodeLines.fail("there are 0 points");
    }
    takeNodes(std::move(nodes), raw);
    lines.next("the number of facets");
    const std::int64_t facets = lines.readCount("number of facets", 8);
    if (facets == 0) lines.fail("there are 0 facets");
    for (std::int64_t f = 0; f < facets; ++f) readFacet(lines, *firstNode, raw);
    lines.next("the number of holes");
    const std::int64_t holes = lines.readCount("number of holes", 8);
    for (std::int64_t h = 0; h < holes; ++h) {
        lines.next("a hole");
        lines.read<std::int64_t>("a hole's number");
        raw.holesWorld.push_back(readPlace(lines));
    }
    if (!lines.tryNext()) return raw;
    const std::int64_t regions = lines.readCount("number of regions", 8);
    bool hasNumbers = false;
    for (std::int64_t r = 0; r < regions; ++r) {
        lines.next("a region");
        lines.read<std::int64_t>("a region's number");
        raw.regions.push_back({readPlace(lines), 0});
        hasNumbers |= !lines.atEnd();
    }
    if (hasNumbers)
        raw.warnings.push_back(
            "Attributes and largest volumes of regions are left out: regions count from 1.");
    return raw;
}

namespace {

/// Words of one line of a table.
class TableLine {
  public:
    TableLine(std::string_view line, char separator) : rest_(line), separator_(separator) {}

    std::optional<std::string_view> next() {
        if (isDone_) return std::nullopt;
        if (separator_ == ' ') {
            rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size()));
            if (rest_.empty()) return std::nullopt;
        }
        std::size_t end = separator_ == ' ' ? rest_.find_first_of(" \t") : rest_.find(separator_);
        if (rest_.starts_with('"')) {  // the separator may stand within
            const std::size_t close = rest_.find('"', 1);
            if (close != std::string_view::npos) end = rest_.find(separator_, close);
        }
        std::string_view word = rest_.substr(0, end);
        isDone_ = end == std::string_view::npos;
        rest_.remove_prefix(isDone_ ? rest_.size() : end + 1);
        const std::size_t begin = std::min(word.find_first_not_of(" \t"), word.size());
        word = word.substr(begin, word.find_last_not_of(" \t") + 1 - begin);
        if (word.size() >= 2 && word.front() == '"' && word.back() == '"')
            word = word.substr(1, word.size() - 2);
        return word;
    }

  private:
    std::string_view rest_;
    char separator_;
    bool isDone_ = false;
};

/// A number, or what stands for none. Where commas don't separate words they may stand before decimals.
std::optional<double> tableNumber(std::string_view word, char separator) {
    if (word.empty() || word == "NA" || word == "N/A") return std::numeric_limits<double>::quiet_NaN();
    std::string withPoint;
    if (separator != ',' && word.find('.') == std::string_view::npos)
        if (const std::size_t comma = word.find(','); comma != std::string_view::npos)
            word = withPoint.append(word).replace(comma, 1, 1, '.');
    return numberOf<double>(word);
}

/// Of "v:2" the 2.
std::optional<std::size_t> componentOf(const std::string& name) {
    const std::size_t size = name.size();
    if (size < 3 || name[size - 2] != ':' || name[size - 1] < '0' || name[size - 1] > '8')
        return std::nullopt;
    return std::size_t(name[size - 1] - '0');
}

class Table {
  public:
    explicit Table(const NamedText& text) : text_(text), rest_(text.bytes) {
        if (rest_.starts_with("\xef\xbb\xbf")) rest_.remove_prefix(3);
    }
    RawSurface read();

  private:
    bool nextLine();
    void readHead();
    void readNames();
    void assignColumns();
    bool isPlace(std::size_t column) const {
        return std::find(place_.begin(), place_.end(), column) != place_.end();
    }
    void readRow(RawSurface& raw);
    [[noreturn]] void fail(const std::string& why) const {
        throw InputError(text_.name + ": line " + std::to_string(lineNumber_) + ": " + why);
    }

    const NamedText& text_;
    std::string_view rest_, line_;
    std::string_view comment_;  // the last one before the first line of numbers
    std::int64_t lineNumber_ = 0;
    char separator_ = ',';
    std::vector<std::string> names_;  // of the columns
    std::vector<double> row_;
    std::array<std::size_t, 3> place_{0, 1, 2};
    std::vector<Field> fields_;
    std::vector<std::vector<std::size_t>> columns_;  // of each field
    std::string warning_;
    bool hasRow_ = false;  // the current line is one
};

bool Table::nextLine() {
    while (!rest_.empty()) {
        ++lineNumber_;
        const std::size_t end = std::min(rest_.find('\n'), rest_.size());
        line_ = rest_.substr(0, end);
        rest_.remove_prefix(std::min(end + 1, rest_.size()));
        if (line_.ends_with('\r')) line_.remove_suffix(1);
        const std::size_t first = line_.find_first_not_of(" \t");
        if (first == std::string_view::npos) continue;
        if (line_[first] != '#') return true;
        comment_ = line_.substr(first + 1);
    }
    return false;
}

/// Names stand in the first line or, as numpy writes them, in a comment before it. Where there are none
/// columns are called by their places.
void Table::readNames() {
    TableLine words(line_, separator_);
    bool isAllNumbers = true;
    while (const auto word = words.next()) {
        isAllNumbers &= tableNumber(*word, separator_).has_value();
        names_.push_back(plainName(std::string(*word)));
    }
    if (names_.size() < 3)
        fail("found " + std::to_string(names_.size()) + " columns, expected the 3 coordinates of a point");
    hasRow_ = isAllNumbers;
    if (!isAllNumbers) return;
    std::vector<std::string> commented;
    TableLine comment(comment_, separator_);
    while (const auto word = comment.next()) commented.push_back(plainName(std::string(*word)));
    if (commented.size() == names_.size()) {
        names_ = std::move(commented);
        return;
    }
    for (std::size_t c = 0; c < names_.size(); ++c) names_[c] = "column_" + std::to_string(c + 1);
}

void Table::readHead() {
    if (!nextLine()) throw InputError(text_.name + ": holds no line of numbers");
    for (const char candidate : {';', '\t', ',', ' '}) {
        separator_ = candidate;
        bool isQuoted = false, isFound = false;
        for (const char c : line_) {
            isQuoted ^= c == '"';
            isFound |= !isQuoted && c == candidate;
        }
        if (isFound) break;
    }
    readNames();
}

/// The place of a point and the components of every field.
void Table::assignColumns() {
    bool isNamed = false;
    std::map<std::string, std::size_t> byName;
    for (std::size_t c = 0; c < names_.size(); ++c) byName.emplace(lowerCase(names_[c]), c);
    for (const std::array<const char*, 3>& called :
         {std::array{"x", "y", "z"}, std::array{"points:0", "points:1", "points:2"},
          std::array{"points_0", "points_1", "points_2"}}) {
        if (!byName.contains(called[0]) || !byName.contains(called[1]) || !byName.contains(called[2]))
            continue;
        for (std::size_t k = 0; k < 3; ++k) place_[k] = byName.at(called[k]);
        isNamed = true;
        break;
    }
    if (!isNamed && !hasRow_) {
        const std::string first = "'" + names_[0] + "', '" + names_[1] + "' and '" + names_[2] + "'";
        for (const char* one : {"x", "y", "z"})
            if (byName.contains(one))
                fail("a column is called " + std::string(one) + ", but not all of x, y and z are there");
        for (int k = 0; k < 3; ++k)
            if (const auto number = tableNumber(names_[std::size_t(k)], separator_);
                number && !names_[std::size_t(k)].empty())
                fail("neither names of columns nor numbers alone: begins with " +
                     printable(names_[0].substr(0, 24)));
        warning_ = "No columns are called x, y and z: " + first + " are taken for them.";
    }
    // Columns v:0, v:1, ... in any order are one field where none is missing.
    std::map<std::string, std::map<std::size_t, std::size_t>> numbered;
    std::set<std::string> whole;
    for (std::size_t c = 0; c < names_.size(); ++c)
        if (const auto number = componentOf(names_[c]); number && !isPlace(c))
            numbered[names_[c].substr(0, names_[c].size() - 2)].emplace(*number, c);
        else
            whole.insert(names_[c]);
    std::set<std::string> taken;
    for (std::size_t c = 0; c < names_.size(); ++c) {
        if (isPlace(c)) continue;
        std::string name = names_[c].empty() ? "column_" + std::to_string(c + 1) : names_[c];
        std::vector<std::size_t> columns{c};
        if (componentOf(name)) {
            const std::string base = name.substr(0, name.size() - 2);
            const auto& parts = numbered.at(base);
            if (parts.rbegin()->first + 1 == parts.size() && !whole.contains(base)) {
                if (parts.at(*componentOf(name)) != c)
                    fail("two columns are called '" + printable(name.substr(0, 64)) + "'");
                if (taken.contains(base)) continue;
                name = base;
                columns.clear();
                for (const auto& [number, column] : parts) columns.push_back(column);
            }
        }
        if (!taken.insert(name).second)
            fail("two columns are called '" + printable(name.substr(0, 64)) + "'");
        fields_.push_back({name, FieldLocation::point, int(columns.size()), {}});
        columns_.push_back(std::move(columns));
    }
}

void Table::readRow(RawSurface& raw) {
    row_.clear();
    TableLine words(line_, separator_);
    while (const auto word = words.next()) {
        const auto number = tableNumber(*word, separator_);
        if (!number) fail("expected a number, found '" + printable(word->substr(0, 24)) + "'");
        row_.push_back(*number);
        if (row_.size() > names_.size()) break;
    }
    if (row_.size() != names_.size())
        fail("has " +
             std::string(row_.size() > names_.size() ? "more than " : std::to_string(row_.size()) + " of ") +
             std::to_string(names_.size()) + " columns");
    const Vec3d place{row_[place_[0]], row_[place_[1]], row_[place_[2]]};
    if (!std::isfinite(place.x) || !std::isfinite(place.y) || !std::isfinite(place.z))
        fail("the point isn't finite");
    raw.points.push_back(place);
    for (std::size_t f = 0; f < fields_.size(); ++f)
        for (const std::size_t c : columns_[f]) fields_[f].values.push_back(row_[c]);
}

RawSurface Table::read() {
    readHead();
    assignColumns();
    RawSurface raw;
    raw.format = "table of points";
    if (hasRow_) readRow(raw);
    while (nextLine()) readRow(raw);
    raw.fields = std::move(fields_);
    if (!warning_.empty()) raw.warnings.push_back(warning_);
    return raw;
}

}  // namespace

RawSurface readCsv(const NamedText& text) {
    return Table(text).read();
}

}  // namespace tessera
