#include "io/xml_check.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>
#include <string_view>

#include "base/error.h"
#include "io/mapped_file.h"

namespace tessera {

namespace {

constexpr std::string_view kSpaces = " \t\r\n";

XmlFileInfo checkXmlFile(const std::string& path, int depth);

std::string quoted(std::string_view text) {
    std::string result = "'";
    for (const char c : text.substr(0, 24)) result += c >= ' ' && c < 127 ? c : '?';
    return result + (text.size() > 24 ? "...'" : "'");
}

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

/// Value of an attribute inside one tag.
std::optional<std::string_view> attribute(std::string_view tag, std::string_view name) {
    for (std::size_t at = tag.find(name); at != std::string_view::npos; at = tag.find(name, at + 1)) {
        if (at == 0 || kSpaces.find(tag[at - 1]) == std::string_view::npos) continue;
        std::size_t next = tag.find_first_not_of(kSpaces, at + name.size());
        if (next == std::string_view::npos || tag[next] != '=') continue;
        next = tag.find_first_not_of(kSpaces, next + 1);
        if (next == std::string_view::npos || (tag[next] != '"' && tag[next] != '\'')) continue;
        const std::size_t close = tag.find(tag[next], next + 1);
        if (close == std::string_view::npos) return std::nullopt;
        return tag.substr(next + 1, close - next - 1);
    }
    return std::nullopt;
}

std::int64_t countAttribute(const std::string& path, std::string_view tag, std::string_view name,
                            std::size_t byte) {
    const auto text = attribute(tag, name);
    if (!text) return 0;
    const std::size_t begin = std::min(text->find_first_not_of(kSpaces), text->size());
    std::int64_t value = -1;
    const auto result = std::from_chars(text->data() + begin, text->data() + text->size(), value);
    const bool onlyDigits = text->find_first_not_of("0123456789 \t\r\n") == std::string_view::npos;
    if (result.ec != std::errc() || !onlyDigits || value > (std::int64_t(1) << 40))
        throw InputError(path + ": byte " + std::to_string(byte) + ": " + std::string(name) + " is " +
                         quoted(*text) + ", expected a count");
    return value;
}

/// The most bytes that a file of this size can hold once unpacked, or nothing when there is no such bound.
std::optional<double> unpackedBound(std::string_view root, std::size_t fileBytes) {
    const std::string_view compressor = attribute(root, "compressor").value_or("");
    if (compressor.empty()) return double(fileBytes);
    if (compressor == "vtkZLibDataCompressor")
        return double(fileBytes) * 1040;  // deflate's best ratio is 1032
    if (compressor == "vtkLZ4DataCompressor") return double(fileBytes) * 256;
    return std::nullopt;
}

/// Checks the files that a parallel or multi-block file names.
void checkPieces(const std::string& path, std::string_view text, std::string_view tagName,
                 std::string_view attributeName, int depth) {
    for (std::size_t at = text.find(tagName); at != std::string_view::npos; at = text.find(tagName, at + 1)) {
        const auto name = attribute(text.substr(at, text.find('>', at) - at), attributeName);
        if (!name || name->empty()) continue;
        const auto piece = std::filesystem::path(path).parent_path() / std::string(*name);
        if (!std::filesystem::exists(piece))
            throw InputError(path + ": byte " + std::to_string(at) + ": names " + piece.string() +
                             ", which doesn't exist");
        checkXmlFile(piece.string(), depth + 1);
    }
}

XmlFileInfo checkXmlFile(const std::string& path, int depth) {
    if (depth > 8) throw InputError(path + ": files name each other more than 8 deep");
    const MappedFile file(path);
    std::string_view text = file.bytes();
    const std::size_t start = skipProlog(text, text.starts_with("\xef\xbb\xbf") ? 3 : 0);
    if (!text.substr(start).starts_with("<VTKFile"))
        throw InputError(path + ": isn't a VTK XML file: byte " + std::to_string(start) + " has " +
                         quoted(text.substr(start)) + ", expected <VTKFile");
    const std::size_t rootEnd = text.find('>', start);
    if (rootEnd == std::string_view::npos)
        throw InputError(path + ": cut off at byte " + std::to_string(text.size()) + ", inside <VTKFile");
    const std::string_view root = text.substr(start, rootEnd - start);
    const auto type = attribute(root, "type");
    if (!type) throw InputError(path + ": <VTKFile has no type");

    const std::string_view endTag = "</VTKFile>";
    const std::size_t end = text.rfind(endTag);
    if (end == std::string_view::npos || end < rootEnd)
        throw InputError(path + ": cut off: byte " + std::to_string(text.size()) +
                         " is its last, and there is no </VTKFile>");
    const std::size_t after = skipProlog(text, end + endTag.size());
    if (after < text.size())
        throw InputError(path + ": damaged: byte " + std::to_string(after) + " has " +
                         quoted(text.substr(after)) + " after </VTKFile>");

    XmlFileInfo info;
    info.type = std::string(*type);
    const std::string_view markup = text.substr(0, text.find("<AppendedData", rootEnd));
    for (std::size_t at = markup.find("<Piece", rootEnd); at != std::string_view::npos;
         at = markup.find("<Piece", at + 1)) {
        const std::string_view tag = markup.substr(at, markup.find('>', at) - at);
        info.points += countAttribute(path, tag, "NumberOfPoints", at);
        info.cells += countAttribute(path, tag, "NumberOfCells", at);
    }
    if (info.type.starts_with("P")) checkPieces(path, markup, "<Piece", "Source", depth);
    if (info.type.starts_with("vtk")) checkPieces(path, markup, "<DataSet", "file", depth);
    if (info.type != "UnstructuredGrid") return info;
    // A point takes 3 numbers and a cell a type, an offset and a node; each takes a byte at least.
    const auto bound = unpackedBound(root, text.size());
    if (bound && 3.0 * double(info.points) + 3.0 * double(info.cells) > *bound)
        throw InputError(path + ": damaged: it declares " + std::to_string(info.points) + " points and " +
                         std::to_string(info.cells) + " cells, more than " + std::to_string(text.size()) +
                         " bytes can hold");
    return info;
}

}  // namespace

XmlFileInfo checkXmlFile(const std::string& path) {
    return checkXmlFile(path, 0);
}

void checkLegacyFile(const std::string& path) {
    const MappedFile file(path);
    const std::string_view text = file.bytes();
    if (!text.starts_with("# vtk DataFile Version"))
        throw InputError(path + ": isn't a VTK file: it begins with " + quoted(text) +
                         ", expected '# vtk DataFile Version'");
    std::size_t at = 0;
    for (int line = 0; line < 4 && at != std::string_view::npos; ++line)
        at = text.find('\n', at == 0 ? 0 : at + 1);
    if (at == std::string_view::npos && text.find("DATASET") == std::string_view::npos)
        throw InputError(path + ": cut off at byte " + std::to_string(text.size()) +
                         ", inside the four lines of its head");
    for (const std::string_view keyword :
         {"\nPOINTS ", "\nCELLS ", "\nCELL_TYPES ", "\nPOINT_DATA ", "\nCELL_DATA "}) {
        for (at = text.find(keyword); at != std::string_view::npos; at = text.find(keyword, at + 1)) {
            std::int64_t count = 0;
            const char* begin = text.data() + at + keyword.size();
            const auto result = std::from_chars(begin, text.data() + text.size(), count);
            // In binary data these letters may come up by chance: then no number follows.
            if (result.ec == std::errc::invalid_argument) continue;
            if (result.ec != std::errc() || count < 0 || count > std::int64_t(text.size()))
                throw InputError(path + ": damaged: byte " + std::to_string(at + 1) + " declares " +
                                 quoted(text.substr(at + 1, text.find('\n', at + 1) - at - 1)) +
                                 ", more than " + std::to_string(text.size()) + " bytes can hold");
        }
    }
}

}  // namespace tessera
