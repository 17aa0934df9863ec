// Input: the text entries of a VDB file's metadata, a line "key value" each.

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "base/check.h"
#include "fuzz_tools.h"
#include "tessera/lattice.h"
#include "vdb/vdb_metadata.h"

namespace tessera {
namespace {

std::map<std::string, std::string> entriesOf(std::string_view input) {
    std::map<std::string, std::string> entries;
    while (!input.empty()) {
        const std::string_view line = input.substr(0, input.find('\n'));
        input.remove_prefix(std::min(line.size() + 1, input.size()));
        const std::size_t space = std::min(line.find(' '), line.size());
        entries[std::string(line.substr(0, space))] = line.substr(std::min(space + 1, line.size()));
    }
    return entries;
}

/// Every leaf is found, under its own key and at its own points, and levels agree on which is where.
void checkTree(const BrickTree& tree) {
    for (std::size_t i = 0; i < tree.leafCount(); ++i) {
        const BrickKey& key = tree.leaves()[i];
        TESSERA_CHECK(tree.findLeaf(key) == std::int64_t(i), "a leaf is found by its key");
        const IndexBox owned = tree.ownedPoints(key);
        TESSERA_CHECK(tree.findLeafAt(key.level, owned.min) == std::int64_t(i), "and at its first point");
        TESSERA_CHECK(tree.findLeafAt(key.level, owned.max - 1) == std::int64_t(i), "and at its last point");
        TESSERA_CHECK(!tree.isRefined(key), "a leaf has no leaf inside");
    }
    for (int level = 0; level < tree.levelCount(); ++level)
        TESSERA_CHECK(std::isfinite(tree.spacingWorld(level)), "spacings are finite");
}

void run(std::string_view input) {
    const VdbMetadata metadata = decodeMetadata(entriesOf(input));
    checkTree(metadata.tree);
    int channels = 0;
    for (const OutputField& field : metadata.fields) channels += field.components;
    int planned = 0;
    for (const GridPlan& grid : planGrids(metadata.fields)) planned += grid.components;
    TESSERA_CHECK(planned == channels, "every channel has a grid");
    const auto entries = encodeMetadata(metadata);
    TESSERA_CHECK(encodeMetadata(decodeMetadata(entries)) == entries, "metadata come back");
}

}  // namespace
}  // namespace tessera

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    tessera::fuzz::expectInputErrorsOnly([&] { tessera::run({reinterpret_cast<const char*>(data), size}); });
    return 0;
}
