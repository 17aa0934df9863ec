// Input: the text of a .node file, a line "%%", the text of an .ele file.

#include <array>
#include <charconv>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/check.h"
#include "fuzz_tools.h"
#include "mesh_files/assemble_mesh.h"
#include "mesh_files/read_tetgen.h"

namespace tessera {
namespace {

void append(std::string& text, double value) {
    std::array<char, 40> digits{};
    text.append(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
}

std::string nodesText(const RawBlock& block) {
    std::size_t attributes = 0;
    for (const Field& field : block.fields) attributes += field.location == FieldLocation::point;
    std::string text = std::to_string(block.points.size()) + " 3 " + std::to_string(attributes) + " 0\n";
    for (std::size_t n = 0; n < block.points.size(); ++n) {
        text += std::to_string(n);
        for (int k = 0; k < 3; ++k) append(text += ' ', block.points[n][k]);
        for (const Field& field : block.fields)
            if (field.location == FieldLocation::point) append(text += ' ', field.values[n]);
        text += '\n';
    }
    return text;
}

std::string elementsText(const RawBlock& block) {
    const bool regions = !block.fields.empty() && block.fields.back().location == FieldLocation::cell;
    std::string text = std::to_string(block.cells.cellCount()) + " 4 " + (regions ? "1\n" : "0\n");
    for (std::size_t e = 0; e < block.cells.kinds.size(); ++e) {
        text += std::to_string(e);
        for (std::size_t i = 0; i < 4; ++i) text += ' ' + std::to_string(block.cells.nodes[4 * e + i]);
        if (regions) append(text += ' ', block.fields.back().values[e]);
        text += '\n';
    }
    return text;
}

/// A mesh written as text and read again is the same mesh.
void checkRoundTrip(const RawBlock& block) {
    const std::string nodes = nodesText(block), elements = elementsText(block);
    const RawMesh again = parseTetgen({"again.node", nodes}, {"again.ele", elements}, {});
    TESSERA_CHECK(nodesText(again.blocks.front()) == nodes, "nodes come back");
    TESSERA_CHECK(elementsText(again.blocks.front()) == elements, "elements come back");
}

void run(std::string_view input) {
    const std::string_view separator = "\n%%\n";
    const std::size_t end = input.find(separator);
    const std::string_view nodes = input.substr(0, end);
    const std::string_view elements =
        end == std::string_view::npos ? std::string_view() : input.substr(end + separator.size());
    RawMesh raw = parseTetgen({"fuzz.node", nodes}, {"fuzz.ele", elements}, {});
    // A number takes two bytes of text at least.
    TESSERA_CHECK(raw.blocks.front().points.size() <= input.size() / 2, "no more nodes than the text holds");
    checkRoundTrip(raw.blocks.front());
    fuzz::checkAssembled(assembleMesh("fuzz.ele", std::move(raw), {}, fuzz::oneThread()));
}

}  // namespace
}  // namespace tessera

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    tessera::fuzz::expectInputErrorsOnly([&] { tessera::run({reinterpret_cast<const char*>(data), size}); });
    return 0;
}
