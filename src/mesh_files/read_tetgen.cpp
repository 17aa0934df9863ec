#include "mesh_files/read_tetgen.h"

#include <filesystem>

#include "files/input_file.h"
#include "files/named_file.h"
#include "mesh_files/number_lines.h"
#include "tessera/error.h"

namespace tessera {

namespace {

void readElements(const NamedText& text, std::int64_t firstNode, RawBlock& block,
                  ImportStatistics& statistics) {
    NumberLines lines(text);
    lines.next("the number of elements");
    const std::int64_t count = lines.readCount("number of elements", 10);
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

std::optional<std::int64_t> readTetgenNodes(NumberLines& lines, RawBlock& block) {
    lines.next("the number of nodes");
    const std::int64_t count = lines.readCount("number of nodes", 8);
    if (count == 0) return std::nullopt;
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

RawMesh parseTetgen(const NamedText& nodes, const NamedText& elements, const ReadOptions& options) {
    RawMesh raw;
    raw.statistics.format = "TetGen";
    RawBlock block;
    NumberLines lines(nodes);
    const std::optional<std::int64_t> firstNode = readTetgenNodes(lines, block);
    if (!firstNode) lines.fail("there are 0 nodes; nodes in a .poly or .smesh file are not read");
    readElements(elements, *firstNode, block, raw.statistics);
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
