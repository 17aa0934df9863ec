#include "mesh_files/read_tetgen.h"

#include <charconv>
#include <filesystem>
#include <limits>
#include <string_view>

#include "files/input_file.h"
#include "files/named_file.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Bytes that a terminal can't show as they are, as \xNN.
std::string printable(std::string_view word) {
    constexpr char kDigits[] = "0123456789abcdef";
    std::string text;
    for (const char c : word) {
        const auto byte = static_cast<unsigned char>(c);
        if (byte >= 0x20 && byte < 0x7f)
            text += c;
        else
            text += {'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15]};
    }
    return text;
}

/// Numbers of a text file, line by line; '#' starts a comment, empty lines don't count.
class NumberLines {
  public:
    explicit NumberLines(const NamedText& text)
        : name_(text.name), bytes_(text.bytes.size()), rest_(text.bytes) {}

    /// Moves to the next line with content; throws when there is none.
    void next(const char* expected) {
        while (!rest_.empty()) {
            ++lineNumber_;
            const std::size_t end = std::min(rest_.find('\n'), rest_.size());
            line_ = rest_.substr(0, end);
            rest_.remove_prefix(std::min(end + 1, rest_.size()));
            line_ = line_.substr(0, line_.find('#'));
            skipSpaces();
            if (!line_.empty()) return;
        }
        throw InputError(name_ + ": ends after line " + std::to_string(lineNumber_) + ", expected " +
                         expected);
    }

    bool atEnd() {
        skipSpaces();
        return line_.empty();
    }

    template <class Number>
    Number read(const char* expected) {
        skipSpaces();
        std::string_view word = line_.substr(0, line_.find_first_of(" \t\r,"));
        const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
        Number value{};
        const auto result = std::from_chars(digits.data(), digits.data() + digits.size(), value);
        const bool outOfRange = result.ec == std::errc::result_out_of_range;
        if (word.empty() || result.ptr != digits.data() + digits.size() ||
            (result.ec != std::errc() && !(outOfRange && std::is_floating_point_v<Number>)))
            fail(std::string("expected ") + expected + ", found '" + printable(word.substr(0, 24)) + "'");
        // from_chars leaves the value alone where it is too small or too large for a double.
        if (outOfRange) value = Number(std::strtod(std::string(digits).c_str(), nullptr));
        line_.remove_prefix(word.size());
        return value;
    }

    [[noreturn]] void fail(const std::string& why) const {
        throw InputError(name_ + ": line " + std::to_string(lineNumber_) + ": " + why);
    }

    std::size_t bytes() const { return bytes_; }

  private:
    void skipSpaces() { line_.remove_prefix(std::min(line_.find_first_not_of(" \t\r,"), line_.size())); }

    std::string name_;
    std::size_t bytes_;
    std::string_view rest_;
    std::string_view line_;
    std::int64_t lineNumber_ = 0;
};

/// @param lineBytes of the shortest line that one item can have; the last one needs no end of line.
std::int64_t readCount(NumberLines& lines, const char* what, double lineBytes) {
    const auto count = lines.read<std::int64_t>(what);
    if (count < 0 || double(count) * lineBytes > double(lines.bytes()) + 1)
        lines.fail("declares " + std::to_string(count) + " as " + what + ", the file has " +
                   std::to_string(lines.bytes()) + " bytes");
    return count;
}

/// Reads the nodes; returns the index of the first.
std::int64_t readNodes(const NamedText& text, RawBlock& block) {
    NumberLines lines(text);
    lines.next("the number of nodes");
    const std::int64_t count = readCount(lines, "number of nodes", 8);
    if (count == 0) lines.fail("there are 0 nodes; nodes in a .poly or .smesh file are not read");
    const auto dimension = lines.atEnd() ? 3 : lines.read<std::int64_t>("dimension");
    if (dimension != 3) lines.fail("dimension is " + std::to_string(dimension) + ", expected 3");
    const auto attributes = lines.atEnd() ? 0 : lines.read<std::int64_t>("number of attributes");
    if (attributes < 0 || attributes > 1000)
        lines.fail("number of attributes is " + std::to_string(attributes));
    const auto base = block.fields.size();
    for (std::int64_t a = 0; a < attributes; ++a) {
        const std::string name = "attribute_" + std::to_string(a + 1);
        block.fields.push_back({name, FieldLocation::point, 1, {}});
        block.arrays.push_back({name, FieldLocation::point, 1, true});
    }
    std::int64_t first = 0;
    for (std::int64_t n = 0; n < count; ++n) {
        lines.next("a node");
        const auto index = lines.read<std::int64_t>("node index");
        if (n == 0) {
            if (index != 0 && index != 1)
                lines.fail("the first node has index " + std::to_string(index) + ", expected 0 or 1");
            first = index;
        }
        if (index != n + first)
            lines.fail("node index is " + std::to_string(index) + ", expected " + std::to_string(n + first));
        Vec3d& point = block.points.emplace_back();
        for (int k = 0; k < 3; ++k) point[k] = lines.read<double>("coordinate");
        for (std::int64_t a = 0; a < attributes; ++a)
            block.fields[base + std::size_t(a)].values.push_back(lines.read<double>("attribute"));
    }
    return first;
}

void readElements(const NamedText& text, std::int64_t firstNode, RawBlock& block,
                  ImportStatistics& statistics) {
    NumberLines lines(text);
    lines.next("the number of elements");
    const std::int64_t count = readCount(lines, "number of elements", 10);
    const auto corners = lines.atEnd() ? 4 : lines.read<std::int64_t>("nodes per element");
    if (corners != 4 && corners != 10)
        lines.fail("nodes per element is " + std::to_string(corners) + ", expected 4 or 10");
    const bool regions = !lines.atEnd() && lines.read<std::int64_t>("number of attributes") > 0;
    Field region{"region", FieldLocation::cell, 1, {}};
    const auto nodeCount = std::int64_t(block.points.size());
    for (std::int64_t e = 0; e < count; ++e) {
        lines.next("an element");
        const auto index = lines.read<std::int64_t>("element index");
        if (index != e + firstNode)
            lines.fail("element index is " + std::to_string(index) + ", expected " +
                       std::to_string(e + firstNode));
        std::int32_t nodes[4] = {};
        for (std::int64_t i = 0; i < corners; ++i) {
            const auto node = lines.read<std::int64_t>("node index");
            if (node < firstNode || node - firstNode >= nodeCount)
                lines.fail("node index " + std::to_string(node) + " is out of range " +
                           std::to_string(firstNode) + " to " + std::to_string(firstNode + nodeCount - 1));
            if (i < 4) nodes[i] = std::int32_t(node - firstNode);
        }
        block.cells.add(CellKind::tet, nodes, 4);
        if (regions) region.values.push_back(lines.read<double>("region attribute"));
    }
    block.sourceCells = count;
    if (corners == 10) statistics.higherOrderCells = count;
    if (!regions) return;
    block.arrays.push_back({region.name, region.location, 1, true});
    block.fields.push_back(std::move(region));
}

}  // namespace

RawMesh parseTetgen(const NamedText& nodes, const NamedText& elements, const ReadOptions& options) {
    RawMesh raw;
    raw.statistics.format = "TetGen";
    RawBlock block;
    const std::int64_t firstNode = readNodes(nodes, block);
    readElements(elements, firstNode, block, raw.statistics);
    std::erase_if(block.fields,
                  [&](const Field& field) { return !isWanted(options, field.name, field.location); });
    raw.blocks.push_back(std::move(block));
    return raw;
}

RawMesh readTetgen(const std::string& path, const ReadOptions& options) {
    const std::filesystem::path given(path);
    const std::string nodePath = std::filesystem::path(given).replace_extension(".node").string();
    const std::string elementPath = std::filesystem::path(given).replace_extension(".ele").string();
    if (const auto folder = allowedFolder(path, options))
        for (const std::string& other : {nodePath, elementPath})
            if (other != path) checkInFolder(*folder, path, other);
    const std::string nodes = readWholeFile(nodePath), elements = readWholeFile(elementPath);
    return parseTetgen({nodePath, nodes}, {elementPath, elements}, options);
}

}  // namespace tessera
