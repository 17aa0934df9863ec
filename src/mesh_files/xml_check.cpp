#include "mesh_files/xml_check.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <filesystem>
#include <optional>
#include <set>
#include <string_view>

#include "files/input_file.h"
#include "files/named_file.h"
#include "files/xml_tags.h"
#include "mesh_files/xml_arrays.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::string_view kSpaces = " \t\r\n";
constexpr int kDeepest = 8;
constexpr std::size_t kLongestHead = 4096;
constexpr std::size_t kQuoted = 32;  // more than a message shows
constexpr double kMostNodes = 2147483647;
constexpr std::int64_t kMostCounted = std::int64_t(1) << 50;

/// Skips blanks, comments and declarations from `at`.
std::size_t skipProlog(InputFile& file, std::size_t at) {
    while (true) {
        at = file.findFirstNotOf(kSpaces, at);
        if (at == InputFile::npos) return file.size();
        const std::string_view text = file.bytesFrom(at, 4);
        std::string_view end;
        if (text.starts_with("<?"))
            end = "?>";
        else if (text.starts_with("<!--"))
            end = "-->";
        else if (text.starts_with("<!"))
            refuseDeclaration(file.path(), at);
        else
            return at;
        const std::size_t close = file.find(end, at);
        if (close == InputFile::npos) return file.size();
        at = close + end.size();
    }
}

/// The names in a file are read as UTF-8. Others could mean another file to the reader.
bool isOtherEncoding(InputFile& file) {
    std::string declaration = file.copy(0, kLongestHead);
    declaration.resize(std::min(declaration.find("?>"), declaration.size()));
    const auto declared =
        declaration.find("<?xml") <= 3 ? attributeOf(declaration, "encoding") : std::nullopt;
    if (!declared) return false;
    std::string name(*declared);
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return char(std::tolower(c)); });
    return name != "utf-8" && name != "us-ascii";
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
    explicit XmlCheck(const std::optional<std::string>& folder) : folder_(folder) {}
    DeclaredSize run(const std::string& path, int depth);

  private:
    /// One file while it is looked at.
    struct File {
        InputFile& input;
        const std::string& path;
        int depth;
        XmlPacking packing;
        std::optional<double> unpackedBound;  ///< the most bytes that the file can hold, unpacked
        DeclaredSize size;
        std::size_t markupEnd = 0;    ///< where appended data begin, or the file's end
        std::string section;          ///< "PointData", "Cells", ...
        std::set<std::string> names;  ///< of the section's arrays so far
        double piecePoints = 0, pieceCells = 0;
        double wholePoints = -1;
        double pointsOfPieces = 0;
        bool pieceHasValues = false;
        bool isOtherEncoding = false;  ///< than UTF-8
    };

    std::size_t checkFrame(File& file) const;
    void checkTag(File& file, const XmlTag& tag);
    void checkGrid(File& file, const XmlTag& tag) const;
    void checkPiece(File& file, const XmlTag& tag) const;
    void checkArray(File& file, const XmlTag& tag) const;
    void checkName(File& file, const XmlTag& tag) const;
    void checkNamedFile(File& file, const XmlTag& tag, std::string_view attribute);
    void checkSums(const File& file) const;
    std::int64_t count(const File& file, const XmlTag& tag, std::string_view name) const;
    std::optional<Extent> extent(const File& file, const XmlTag& tag, std::string_view name) const;

    const std::optional<std::string>& folder_;
    std::set<std::string> known_;  ///< files that were looked at
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
    InputFile& input = file.input;
    const std::size_t start = skipProlog(input, input.bytesFrom(0, 3).starts_with("\xef\xbb\xbf") ? 3 : 0);
    if (!input.bytesFrom(start, 8).starts_with("<VTKFile"))
        throw InputError(path + ": isn't a VTK XML file: byte " + std::to_string(start) +
                         " is not the first of <VTKFile");
    const auto tag = XmlTags(input, start, start + 1).next();
    if (!tag)
        throw InputError(path + ": cut off at byte " + std::to_string(input.size()) + ", inside <VTKFile");
    const auto type = attributeOf(tag->text, "type");
    if (!type) throw InputError(path + ": <VTKFile has no type");
    file.size.type = std::string(*type);

    const std::string_view endTag = "</VTKFile>";
    const std::size_t end = input.rfind(endTag);
    if (end == InputFile::npos || end < tag->end)
        throw InputError(path + ": cut off: byte " + std::to_string(input.size()) +
                         " is its last, and there is no </VTKFile>");
    const std::size_t after = skipProlog(input, end + endTag.size());
    if (after < input.size())
        throw InputError(path + ": damaged: byte " + std::to_string(after) + " has " +
                         quoted(input.bytesFrom(after, kQuoted)) + " after </VTKFile>");
    file.markupEnd = std::min(input.find("<AppendedData", tag->end), input.size());
    file.packing =
        packingOf(input, tag->text, file.markupEnd == input.size() ? InputFile::npos : file.markupEnd);
    if (file.packing.largestRatio) file.unpackedBound = *file.packing.largestRatio * double(input.size());
    return tag->end;
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
    const std::int64_t points = count(file, tag, "NumberOfPoints");
    std::int64_t cells = 0;
    for (const char* kind :
         {"NumberOfCells", "NumberOfVerts", "NumberOfLines", "NumberOfStrips", "NumberOfPolys"})
        addCount(cells, count(file, tag, kind));
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
                         " components is more than " + std::to_string(file.input.size()) + " bytes can hold");
    if (file.piecePoints == 0 || (file.section == "CellData" && tuples == 0)) return;
    checkPackedArray(file.input, tag, file.packing);
    if (file.wholePoints < 0 || file.pieceHasValues) return;
    if (file.section != "PointData" && file.section != "CellData") return;
    file.pieceHasValues = true;
    addCount(file.size.gridPoints, std::int64_t(file.piecePoints));
}

/// Where files are made of others, VTK itself opens these, and doesn't bear two arrays of one name.
void XmlCheck::checkName(File& file, const XmlTag& tag) const {
    const bool isAlone = file.depth == 0 && !file.size.type.starts_with('P');
    const bool isField = file.section.ends_with("PointData") || file.section.ends_with("CellData");
    if (isAlone || !isField) return;
    const auto name = attributeOf(tag.text, "Name");
    if (name && !file.names.insert(std::string(*name)).second)
        throw InputError(file.path + ": byte " + std::to_string(tag.begin) + ": " + file.section +
                         " has a second array named " + quoted(*name) +
                         "; the parts of a parallel or multi-block file need names of their own");
}

void XmlCheck::checkNamedFile(File& file, const XmlTag& tag, std::string_view attribute) {
    const auto name = attributeOf(tag.text, attribute);
    if (!name || name->empty()) return;
    // The reader would change them, or take them for absolute.
    const std::string decoded = decodeEntities(*name);
    const bool isOther = std::any_of(name->begin(), name->end(), [&](unsigned char c) {
        return c < ' ' || (c > 0x7e && file.isOtherEncoding);
    });
    if (isOther || decoded.find(':') == 1)
        throw InputError(file.path + ": byte " + std::to_string(tag.begin) + ": names a file " +
                         quoted(*name) + ", which isn't a name that every system reads alike");
    const auto piece = std::filesystem::path(file.path).parent_path() / decoded;
    if (folder_) checkInFolder(*folder_, file.path, piece.string());
    std::error_code error;
    if (!std::filesystem::exists(piece, error))
        throw InputError(file.path + ": byte " + std::to_string(tag.begin) + ": names " + piece.string() +
                         ", which doesn't exist");
    // A file that is named a thousand times is no reason to allow a thousand times its memory.
    if (known_.contains(std::filesystem::weakly_canonical(piece, error).string())) return;
    const DeclaredSize size = run(piece.string(), file.depth + 1);
    addCount(file.size.fileBytes, size.fileBytes);
    addCount(file.size.cellsOfAll, size.cellsOfAll);
    addCount(file.size.gridPoints, size.gridPoints);
}

void XmlCheck::checkTag(File& file, const XmlTag& tag) {
    if (tag.name() == file.size.type) {
        checkGrid(file, tag);
    } else if (tag.name() == "Piece") {
        if (!file.size.type.starts_with('P')) return checkPiece(file, tag);
        if (const auto box = extent(file, tag, "Extent")) file.pointsOfPieces += box->pointCount();
        checkNamedFile(file, tag, "Source");
    } else if (tag.name() == "DataSet" && file.size.type.starts_with("vtk")) {
        checkNamedFile(file, tag, "file");
    } else if (tag.name() == "DataArray" || tag.name() == "Array") {
        checkName(file, tag);
        checkArray(file, tag);
    } else if (tag.name() == "PDataArray") {
        checkName(file, tag);
    } else {
        file.section = tag.name();
        file.names.clear();
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
                         ", more than " + std::to_string(file.input.size()) + " bytes can hold");
}

DeclaredSize XmlCheck::run(const std::string& path, int depth) {
    if (depth > kDeepest) throw InputError(path + ": files name each other more than 8 deep");
    InputFile input(path);
    File file{input, path, depth, {}, {}, {}, 0, {}, {}, 0, 0, -1, 0, false, false};
    file.isOtherEncoding = isOtherEncoding(input);
    file.size.fileBytes = std::int64_t(input.size());
    const std::size_t inside = checkFrame(file);
    XmlTags tags(input, inside, file.markupEnd);
    while (const auto tag = tags.next()) checkTag(file, *tag);
    checkSums(file);
    std::error_code error;
    known_.insert(std::filesystem::weakly_canonical(path, error).string());
    return file.size;
}

}  // namespace

DeclaredSize checkXmlFile(const std::string& path, const std::optional<std::string>& folder) {
    return XmlCheck(folder).run(path, 0);
}

}  // namespace tessera
