#include "io/xml_check.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <map>
#include <optional>
#include <string_view>

#include "base/error.h"
#include "io/mapped_file.h"
#include "io/xml_arrays.h"
#include "io/xml_tags.h"

namespace tessera {

namespace {

constexpr std::string_view kSpaces = " \t\r\n";
constexpr int kDeepest = 8;
constexpr double kMostNodes = 2147483647;
constexpr std::int64_t kMostCounted = std::int64_t(1) << 50;

/// Skips blanks, comments and declarations from `at`.
std::size_t skipProlog(std::string_view text, std::size_t at) {
    while (true) {
        at = text.find_first_not_of(kSpaces, at);
        if (at == std::string_view::npos) return text.size();
        std::string_view end;
        if (text.substr(at).starts_with("<?"))
            end = "?>";
        else if (text.substr(at).starts_with("<!--"))
            end = "-->";
        else if (text.substr(at).starts_with("<!"))
            end = ">";
        else
            return at;
        const std::size_t close = text.find(end, at);
        if (close == std::string_view::npos) return text.size();
        at = close + end.size();
    }
}

/// Adds without overflow: files may name each other many times.
void addCount(std::int64_t& sum, std::int64_t count) {
    sum = std::min(kMostCounted, sum + std::min(kMostCounted, count));
}

/// A box of grid points, as an attribute has it.
struct Extent {
    std::array<double, 3> points{};
    double pointCount() const { return points[0] * points[1] * points[2]; }
    double cellCount() const {
        double count = pointCount() > 0 ? 1 : 0;
        for (const double n : points) count *= std::max(1.0, n - 1);
        return count;
    }
};

class XmlCheck {
  public:
    explicit XmlCheck(std::map<std::string, DeclaredSize>& known) : known_(known) {}
    DeclaredSize run(const std::string& path, int depth);

  private:
    /// One file while it is looked at.
    struct File {
        const std::string& path;
        std::string_view text;
        int depth;
        XmlPacking packing;
        std::optional<double> unpackedBound;  ///< the most bytes that the file can hold, unpacked
        DeclaredSize size;
        std::string_view section;  ///< "PointData", "Cells", ...
        double piecePoints = 0, pieceCells = 0;
        double wholePoints = -1;
        double pointsOfPieces = 0;
        bool pieceHasValues = false;
    };

    std::size_t checkFrame(File& file) const;
    void checkTag(File& file, const XmlTag& tag);
    void checkGrid(File& file, const XmlTag& tag) const;
    void checkPiece(File& file, const XmlTag& tag) const;
    void checkArray(File& file, const XmlTag& tag) const;
    void checkNamedFile(File& file, const XmlTag& tag, std::string_view attribute);
    void checkSums(const File& file) const;
    std::int64_t count(const File& file, const XmlTag& tag, std::string_view name) const;
    std::optional<Extent> extent(const File& file, const XmlTag& tag, std::string_view name) const;

    std::map<std::string, DeclaredSize>& known_;
};

std::int64_t XmlCheck::count(const File& file, const XmlTag& tag, std::string_view name) const {
    const auto text = attributeOf(tag.text, name);
    if (!text) return 0;
    const std::size_t begin = std::min(text->find_first_not_of(kSpaces), text->size());
    std::int64_t value = -1;
    const auto result = std::from_chars(text->data() + begin, text->data() + text->size(), value);
    const bool onlyDigits = text->find_first_not_of("0123456789 \t\r\n") == std::string_view::npos;
    if (result.ec != std::errc() || !onlyDigits || value > (std::int64_t(1) << 40))
        throw InputError(file.path + ": byte " + std::to_string(tag.begin) + ": " + std::string(name) +
                         " is " + quoted(*text) + ", expected a count");
    return value;
}

std::optional<Extent> XmlCheck::extent(const File& file, const XmlTag& tag, std::string_view name) const {
    const auto text = attributeOf(tag.text, name);
    if (!text) return std::nullopt;
    const auto refuse = [&](const std::string& why) {
        throw InputError(file.path + ": byte " + std::to_string(tag.begin) + ": " + std::string(name) +
                         " is " + quoted(*text) + ", " + why);
    };
    std::array<std::int32_t, 6> ends{};
    const char* next = text->data();
    const char* end = next + text->size();
    for (std::int32_t& number : ends) {
        while (next < end && kSpaces.find(*next) != std::string_view::npos) ++next;
        const auto result = std::from_chars(next, end, number);
        if (result.ec != std::errc()) refuse("expected six 32-bit numbers");
        next = result.ptr;
    }
    Extent extent;
    for (std::size_t a = 0; a < 3; ++a)
        extent.points[a] = std::max(0.0, double(ends[2 * a + 1]) - double(ends[2 * a]) + 1);
    if (extent.pointCount() > kMostNodes) refuse("more than 2147483647 points");
    return extent;
}

/// Checks the file from its first to its last byte, and returns where the tags inside <VTKFile> begin.
std::size_t XmlCheck::checkFrame(File& file) const {
    const std::string& path = file.path;
    const std::string_view text = file.text;
    const std::size_t start = skipProlog(text, text.starts_with("\xef\xbb\xbf") ? 3 : 0);
    if (!text.substr(start).starts_with("<VTKFile"))
        throw InputError(path + ": isn't a VTK XML file: byte " + std::to_string(start) + " has " +
                         quoted(text.substr(start)) + ", expected <VTKFile");
    const std::size_t rootEnd = text.find('>', start);
    if (rootEnd == std::string_view::npos)
        throw InputError(path + ": cut off at byte " + std::to_string(text.size()) + ", inside <VTKFile");
    const std::string_view root = text.substr(start, rootEnd - start);
    const auto type = attributeOf(root, "type");
    if (!type) throw InputError(path + ": <VTKFile has no type");
    file.size.type = std::string(*type);

    const std::string_view endTag = "</VTKFile>";
    const std::size_t end = text.rfind(endTag);
    if (end == std::string_view::npos || end < rootEnd)
        throw InputError(path + ": cut off: byte " + std::to_string(text.size()) +
                         " is its last, and there is no </VTKFile>");
    const std::size_t after = skipProlog(text, end + endTag.size());
    if (after < text.size())
        throw InputError(path + ": damaged: byte " + std::to_string(after) + " has " +
                         quoted(text.substr(after)) + " after </VTKFile>");
    const std::size_t appended = text.find("<AppendedData", rootEnd);
    file.packing = packingOf(text, root, appended);
    if (file.packing.largestRatio) file.unpackedBound = *file.packing.largestRatio * double(text.size());
    return rootEnd;
}

/// <StructuredGrid WholeExtent="..."> and the like: VTK allocates for that box, whatever its pieces hold.
void XmlCheck::checkGrid(File& file, const XmlTag& tag) const {
    if (const auto whole = extent(file, tag, "WholeExtent")) file.wholePoints = whole->pointCount();
}

void XmlCheck::checkPiece(File& file, const XmlTag& tag) const {
    file.section = {};
    file.pieceHasValues = false;
    if (const auto box = extent(file, tag, "Extent")) {
        file.piecePoints = box->pointCount();
        file.pieceCells = box->cellCount();
        file.pointsOfPieces += file.piecePoints;
        return;
    }
    const std::int64_t points = count(file, tag, "NumberOfPoints"), cells = count(file, tag, "NumberOfCells");
    file.piecePoints = double(points);
    file.pieceCells = double(cells);
    addCount(file.size.points, points);
    addCount(file.size.cells, cells);
    addCount(file.size.cellsOfAll, cells);
}

/// An array's values take a byte each at least.
void XmlCheck::checkArray(File& file, const XmlTag& tag) const {
    const std::int64_t components = std::max<std::int64_t>(1, count(file, tag, "NumberOfComponents"));
    double tuples = double(count(file, tag, "NumberOfTuples"));
    if (file.section == "PointData" || file.section == "Points") tuples = file.piecePoints;
    if (file.section == "CellData") tuples = file.pieceCells;
    if (file.unpackedBound && double(components) * tuples > *file.unpackedBound)
        throw InputError(file.path + ": damaged: byte " + std::to_string(tag.begin) + ": array " +
                         quoted(attributeOf(tag.text, "Name").value_or("")) + " of " +
                         std::to_string(std::int64_t(tuples)) + " values with " + std::to_string(components) +
                         " components is more than " + std::to_string(file.text.size()) + " bytes can hold");
    if (file.piecePoints == 0 || (file.section == "CellData" && tuples == 0)) return;
    checkPackedArray(file.path, file.text, tag, file.packing);
    if (file.wholePoints < 0 || file.pieceHasValues) return;
    if (file.section != "PointData" && file.section != "CellData") return;
    file.pieceHasValues = true;
    addCount(file.size.gridPoints, std::int64_t(file.piecePoints));
}

void XmlCheck::checkNamedFile(File& file, const XmlTag& tag, std::string_view attribute) {
    const auto name = attributeOf(tag.text, attribute);
    if (!name || name->empty()) return;
    const auto piece = std::filesystem::path(file.path).parent_path() / std::string(*name);
    std::error_code error;
    if (!std::filesystem::exists(piece, error))
        throw InputError(file.path + ": byte " + std::to_string(tag.begin) + ": names " + piece.string() +
                         ", which doesn't exist");
    const DeclaredSize size = run(piece.string(), file.depth + 1);
    addCount(file.size.fileBytes, size.fileBytes);
    addCount(file.size.cellsOfAll, size.cellsOfAll);
    addCount(file.size.gridPoints, size.gridPoints);
}

void XmlCheck::checkTag(File& file, const XmlTag& tag) {
    if (tag.name == file.size.type) {
        checkGrid(file, tag);
    } else if (tag.name == "Piece") {
        if (!file.size.type.starts_with('P')) return checkPiece(file, tag);
        if (const auto box = extent(file, tag, "Extent")) file.pointsOfPieces += box->pointCount();
        checkNamedFile(file, tag, "Source");
    } else if (tag.name == "DataSet" && file.size.type.starts_with("vtk")) {
        checkNamedFile(file, tag, "file");
    } else if (tag.name == "DataArray" || tag.name == "Array") {
        checkArray(file, tag);
    } else {
        file.section = tag.name;
    }
}

void XmlCheck::checkSums(const File& file) const {
    const std::string& type = file.size.type;
    // A piece of a parallel file may name the box of the whole.
    if (file.depth == 0 && file.wholePoints > file.pointsOfPieces)
        throw InputError(file.path + ": damaged: its WholeExtent has " +
                         std::to_string(std::int64_t(file.wholePoints)) + " points, its pieces have " +
                         std::to_string(std::int64_t(file.pointsOfPieces)));
    // A point takes 3 numbers and a cell a type, an offset and a node; each takes a byte at least.
    double numbers = 3 * double(file.size.points) + 3 * double(file.size.cells);
    if (type == "StructuredGrid") numbers = 3 * file.pointsOfPieces;
    if (file.unpackedBound && numbers > *file.unpackedBound)
        throw InputError(file.path + ": damaged: it declares " +
                         (type == "StructuredGrid"
                              ? std::to_string(std::int64_t(file.pointsOfPieces)) + " points"
                              : std::to_string(file.size.points) + " points and " +
                                    std::to_string(file.size.cells) + " cells") +
                         ", more than " + std::to_string(file.text.size()) + " bytes can hold");
}

DeclaredSize XmlCheck::run(const std::string& path, int depth) {
    if (depth > kDeepest) throw InputError(path + ": files name each other more than 8 deep");
    std::error_code error;
    const std::string key = std::filesystem::weakly_canonical(path, error).string();
    if (const auto before = known_.find(key); before != known_.end()) return before->second;
    const MappedFile mapped(path);
    File file{path, mapped.bytes(), depth, {}, {}, {}, {}, 0, 0, -1, 0, false};
    file.size.fileBytes = std::int64_t(file.text.size());
    const std::size_t inside = checkFrame(file);
    const std::string_view markup = file.text.substr(0, file.text.find("<AppendedData", inside));
    XmlTags tags(markup, inside);
    while (const auto tag = tags.next()) checkTag(file, *tag);
    checkSums(file);
    known_[key] = file.size;
    return file.size;
}

}  // namespace

DeclaredSize checkXmlFile(const std::string& path) {
    std::map<std::string, DeclaredSize> known;
    return XmlCheck(known).run(path, 0);
}

}  // namespace tessera
