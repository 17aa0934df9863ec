#include "mesh_files/assemble_mesh.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "base/parallel.h"
#include "base/text.h"
#include "files/name_list.h"
#include "files/named_file.h"
#include "mesh/mesh_quality.h"
#include "mesh_files/join_parts.h"
#include "mesh_files/raw_mesh.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::int64_t kAssembleChunk = 1 << 15;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string coordinateText(const Vec3d& p) {
    return "(" + std::to_string(p.x) + ", " + std::to_string(p.y) + ", " + std::to_string(p.z) + ")";
}

/// Calls visit(node) for every node index of a cell; a polyhedron's stream has counts between them.
template <class Nodes, class Visit>
void forEachNode(CellKind kind, Nodes nodes, std::int64_t count, const Visit& visit) {
    if (kind != CellKind::polyhedron) {
        for (std::int64_t i = 0; i < count; ++i) visit(nodes[i]);
        return;
    }
    std::int64_t at = 1;
    for (std::int32_t f = 0; f < nodes[0]; ++f) {
        const std::int64_t faceNodes = nodes[at++];
        for (std::int64_t i = 0; i < faceNodes; ++i) visit(nodes[at++]);
    }
}

template <class Visit>
void forEachNode(RawBlock& block, const Execution& execution, const Visit& visit) {
    parallelForChunks(execution, std::int64_t(block.tets.size()), kAssembleChunk,
                      [&](std::int64_t begin, std::int64_t end) {
                          for (auto e = std::size_t(begin); e < std::size_t(end); ++e)
                              for (std::int32_t& node : block.tets[e]) visit(node);
                      });
    CellList& cells = block.cells;
    parallelForChunks(execution, cells.cellCount(), kAssembleChunk,
                      [&](std::int64_t begin, std::int64_t end) {
                          for (std::int64_t c = begin; c < end; ++c) {
                              const std::int64_t first = cells.begin[std::size_t(c)];
                              forEachNode(cells.kinds[std::size_t(c)], cells.nodes.data() + first,
                                          cells.begin[std::size_t(c) + 1] - first, visit);
                          }
                      });
}

template <class Item>
void keepOnly(const std::vector<std::int32_t>& kept, std::vector<Item>& items) {
    std::vector<Item> chosen(kept.size());
    for (std::size_t i = 0; i < kept.size(); ++i) chosen[i] = items[std::size_t(kept[i])];
    items = std::move(chosen);
}

/// Drops the nodes that no cell uses and renumbers. Returns the old index of every node that stays; empty
/// when all do.
/// @param blockIndex, blockCount of the blocks of this block's file.
std::vector<std::int32_t> dropUnusedNodes(const std::string& path, RawBlock& block, std::size_t blockIndex,
                                          std::size_t blockCount, const Execution& execution) {
    std::vector<std::int32_t> newIndex(block.points.size(), -1);
    forEachNode(block, execution, [&](std::int32_t node) {
        std::atomic_ref(newIndex[std::size_t(node)]).store(0, std::memory_order_relaxed);
    });
    std::vector<std::int32_t> kept;
    kept.reserve(block.points.size());
    for (std::size_t i = 0; i < newIndex.size(); ++i) {
        if (newIndex[i] < 0) continue;
        const Vec3d& p = block.points[i];
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
            throw InputError(path + ": node " + std::to_string(i) + " (counted from 0)" +
                             (blockCount > 1 ? " of block " + std::to_string(blockIndex) : "") +
                             " has a coordinate that isn't finite: " + coordinateText(p));
        newIndex[i] = std::int32_t(kept.size());
        kept.push_back(std::int32_t(i));
    }
    if (kept.size() == block.points.size()) return {};
    forEachNode(block, execution, [&](std::int32_t& node) { node = newIndex[std::size_t(node)]; });
    keepOnly(kept, block.points);
    if (!block.nodeIds.empty()) keepOnly(kept, block.nodeIds);
    return kept;
}

/// Keeps the tuples of the chosen items, in this order.
template <class Index>
void gatherTuples(Field& field, const std::vector<Index>& items, const Execution& execution) {
    const auto components = std::size_t(field.components);
    std::vector<double> values(items.size() * components);
    parallelForChunks(
        execution, std::int64_t(items.size()), kAssembleChunk, [&](std::int64_t begin, std::int64_t end) {
            for (auto i = std::size_t(begin); i < std::size_t(end); ++i)
                for (std::size_t c = 0; c < components; ++c)
                    values[i * components + c] = field.values[std::size_t(items[i]) * components + c];
        });
    field.values = std::move(values);
}

/// Appends the merged index of every point of every block of one file: points with one number are one, where
/// all have numbers and these are dense.
/// @param count the number of merged points, which grows.
void appendMergedIndices(std::span<const RawBlock> blocks, std::size_t& count,
                         std::vector<std::vector<std::int32_t>>& indices) {
    constexpr std::int64_t kMostNumbersAPoint = 64;  // a table of more isn't worth the memory
    bool numbered = true;
    std::int64_t largest = 0, points = 0;
    for (const RawBlock& block : blocks) {
        numbered = numbered && block.nodeIds.size() == block.points.size();
        for (const std::int64_t id : block.nodeIds) {
            numbered = numbered && id >= 0;
            largest = std::max(largest, id);
        }
        points += std::int64_t(block.points.size());
    }
    numbered = numbered && largest < kMostNumbersAPoint * points;
    std::vector<std::int32_t> indexOf(numbered ? std::size_t(largest) + 1 : 0, -1);
    for (const RawBlock& block : blocks) {
        std::vector<std::int32_t>& index = indices.emplace_back(block.points.size());
        for (std::size_t i = 0; i < index.size(); ++i) {
            if (!numbered) {
                index[i] = std::int32_t(count++);
                continue;
            }
            std::int32_t& merged = indexOf[std::size_t(block.nodeIds[i])];
            if (merged < 0) merged = std::int32_t(count++);
            index[i] = merged;
        }
    }
}

/// The blocks of the file that block b comes from.
std::span<RawBlock> blocksOfFile(std::vector<RawBlock>& blocks, std::size_t b) {
    std::size_t begin = b, end = b + 1;
    while (begin > 0 && blocks[begin - 1].part == blocks[b].part) --begin;
    while (end < blocks.size() && blocks[end].part == blocks[b].part) ++end;
    return std::span(blocks).subspan(begin, end - begin);
}

/// Where fields are the same on both sides, the mesh goes on across the borders of its parts.
void joinAcrossParts(RawBlock& all, const std::vector<std::size_t>& firstPoint, ImportStatistics& statistics,
                     const Execution& execution) {
    const JoinedPoints joined = joinParts(all, firstPoint, execution);
    if (joined.apart > 0)
        statistics.warnings.push_back(std::to_string(joined.apart) +
                                      " nodes on borders of parts have other values there than in the part "
                                      "beside; they stay nodes of their own.");
    if (joined.kept.size() == all.points.size()) return;
    forEachNode(all, execution, [&](std::int32_t& node) { node = joined.newIndex[std::size_t(node)]; });
    keepOnly(joined.kept, all.points);
    for (Field& field : all.fields)
        if (field.location == FieldLocation::point) gatherTuples(field, joined.kept, execution);
}

/// One warning for all fields of which the same is to be said.
void warnOfFields(const std::vector<std::string>& names, const std::string& what,
                  ImportStatistics& statistics) {
    if (names.size() == 1) statistics.warnings.push_back("Field '" + names[0] + "' is " + what + ".");
    if (names.size() > 1)
        statistics.warnings.push_back(std::to_string(names.size()) + " fields are " + what + ": " +
                                      nameList(names) + ".");
}

/// Makes cells of a block's tetrahedra.
void listCells(RawBlock& block) {
    for (const std::array<std::int32_t, 4>& tet : block.tets) block.cells.add(CellKind::tet, tet.data(), 4);
    block.tets = {};
}

/// One block with points, cells and fields of all; cell fields have one tuple for every listed cell.
RawBlock mergeBlocks(const std::string& path, RawMesh& raw, const ReadOptions& options,
                     const Execution& execution) {
    std::size_t points = 0, cells = 0;
    for (std::size_t b = 0; b < raw.blocks.size(); ++b) {
        RawBlock& block = raw.blocks[b];
        const std::span<RawBlock> beside = blocksOfFile(raw.blocks, b);
        const std::string& file = block.part == 0 ? path : options.otherParts[block.part - 1];
        const std::vector<std::int32_t> kept =
            dropUnusedNodes(file, block, std::size_t(&block - beside.data()), beside.size(), execution);
        for (Field& field : block.fields) {
            if (field.location == FieldLocation::point && !kept.empty())
                gatherTuples(field, kept, execution);
            else if (field.location == FieldLocation::point && block.points.empty())
                field.values.clear();
            else if (field.location == FieldLocation::cell && !block.sourceCell.empty())
                gatherTuples(field, block.sourceCell, execution);
        }
        points += block.points.size();
        cells += std::size_t(block.cellCount());
    }
    if (points > std::size_t(std::numeric_limits<std::int32_t>::max()))
        throw InputError(meshName(path, options) + ": has " + std::to_string(points) +
                         " nodes; at most 2147483647 are possible");
    if (raw.blocks.size() == 1) return std::move(raw.blocks[0]);

    RawBlock all;
    std::map<std::pair<FieldLocation, std::string>, std::size_t> fieldOf;
    std::set<std::pair<FieldLocation, std::string>> partial;
    std::size_t mergedPoints = 0, cellBase = 0;
    std::vector<std::vector<std::int32_t>> indices;
    std::vector<std::size_t> firstPointOfPart;
    for (std::size_t b = 0; b < raw.blocks.size(); b = indices.size()) {
        firstPointOfPart.push_back(mergedPoints);
        appendMergedIndices(blocksOfFile(raw.blocks, b), mergedPoints, indices);
    }
    all.points.resize(mergedPoints);
    for (std::size_t b = 0; b < raw.blocks.size(); ++b) {
        RawBlock& block = raw.blocks[b];
        const std::vector<std::int32_t> index = std::move(indices[b]);
        forEachNode(block, execution, [&](std::int32_t& node) { node = index[std::size_t(node)]; });
        listCells(block);
        for (std::size_t i = 0; i < index.size(); ++i) all.points[std::size_t(index[i])] = block.points[i];
        all.cells.kinds.insert(all.cells.kinds.end(), block.cells.kinds.begin(), block.cells.kinds.end());
        const auto nodeBase = std::int64_t(all.cells.nodes.size());
        for (std::size_t c = 1; c < block.cells.begin.size(); ++c)
            all.cells.begin.push_back(block.cells.begin[c] + nodeBase);
        all.cells.nodes.insert(all.cells.nodes.end(), block.cells.nodes.begin(), block.cells.nodes.end());
        all.arrays.insert(all.arrays.end(), block.arrays.begin(), block.arrays.end());
        std::set<std::size_t> seen;
        for (Field& field : block.fields) {
            const bool atPoints = field.location == FieldLocation::point;
            const auto key = std::pair(field.location, field.name);
            auto place = fieldOf.find(key);
            if (place == fieldOf.end()) {
                place = fieldOf.emplace(key, all.fields.size()).first;
                all.fields.push_back({field.name, field.location, field.components, {}});
                all.fields.back().values.assign(
                    (atPoints ? mergedPoints : cells) * std::size_t(field.components), kNan);
                if (cellBase > 0) partial.insert(key);
            }
            Field& target = all.fields[place->second];
            if (target.components != field.components) continue;
            seen.insert(place->second);
            const auto components = std::size_t(field.components);
            const std::size_t items = field.values.size() / components;
            for (std::size_t i = 0; i < items; ++i) {
                const std::size_t item = atPoints ? std::size_t(index[i]) : cellBase + i;
                std::copy_n(field.values.begin() + std::ptrdiff_t(i * components), components,
                            target.values.begin() + std::ptrdiff_t(item * components));
            }
        }
        if (!block.cells.kinds.empty())
            for (const auto& [key, field] : fieldOf)
                if (!seen.contains(field)) partial.insert(key);
        cellBase += block.cells.kinds.size();
        block = {};
    }
    std::vector<std::string> partialNames;
    for (const auto& [location, name] : partial) partialNames.push_back(name);
    warnOfFields(partialNames,
                 std::string("absent in some ") + (firstPointOfPart.size() > 1 ? "parts" : "blocks") +
                     " or of another number of components there: NaN in these",
                 raw.statistics);
    if (firstPointOfPart.size() > 1) joinAcrossParts(all, firstPointOfPart, raw.statistics, execution);
    return all;
}

/// Gives a cell field another name when a point field has the same, so that names are unique.
void renameTwins(RawBlock& block, ImportStatistics& statistics) {
    std::vector<std::string> twins, newNames;
    std::set<std::string> pointNames;
    for (const ArrayInfo& array : block.arrays)
        if (array.location == FieldLocation::point) pointNames.insert(array.name);
    for (Field& field : block.fields) {
        if (field.location != FieldLocation::cell || !pointNames.contains(field.name)) continue;
        twins.push_back(field.name);
        newNames.push_back(field.name = cellFieldName(field.name));
    }
    if (!twins.empty())
        statistics.warnings.push_back(
            twins.size() == 1 ? "Both points and cells have a field '" + twins[0] +
                                    "'; that of the cells is called '" + newNames[0] + "'."
                              : "Points and cells both have " + std::to_string(twins.size()) +
                                    " fields of one name: " + nameList(twins) +
                                    "; those of the cells are called " + nameList(newNames) + ".");
    for (ArrayInfo& array : block.arrays)
        if (array.location == FieldLocation::cell && pointNames.contains(array.name))
            array.name = cellFieldName(array.name);
}

void selectFields(const std::string& path, RawBlock& block, const ReadOptions& options) {
    for (const std::string& name : options.fields) {
        bool isThere = false, isNumeric = false;
        for (const ArrayInfo& array : block.arrays) {
            if (!isFieldCalled(name, array.name, array.location)) continue;
            isThere = true;
            isNumeric = isNumeric || array.numeric;
            if (array.numeric && array.components > 9)
                throw InputError(path + ": field '" + array.name + "' has " +
                                 std::to_string(array.components) + " components; fields have 1 to 9");
        }
        if (isNumeric) continue;
        if (isThere) throw InputError(path + ": field '" + name + "' isn't numeric");
        std::set<std::string> available;
        for (const ArrayInfo& array : block.arrays)
            if (array.numeric) available.insert(array.name);
        std::string list;
        for (const std::string& there : available) list += (list.empty() ? "" : ", ") + there;
        throw InputError(path + ": there is no field '" + name +
                         "'; there are: " + (list.empty() ? "none" : list));
    }
    if (options.fields.empty()) return;
    std::erase_if(block.fields, [&](const Field& field) {
        return std::none_of(options.fields.begin(), options.fields.end(), [&](const std::string& called) {
            return isFieldCalled(called, field.name, field.location);
        });
    });
}

void warnSkippedArrays(const RawBlock& block, ImportStatistics& statistics) {
    std::set<std::string> wide, text;
    for (const ArrayInfo& array : block.arrays) {
        if (!array.numeric)
            text.insert(array.name);
        else if (array.components > 9 || array.components < 1)
            wide.insert(array.name);
    }
    warnOfFields({wide.begin(), wide.end()}, "left out: fields have 1 to 9 components", statistics);
    warnOfFields({text.begin(), text.end()}, "left out: only numbers can be resampled", statistics);
}

/// Appends the means for added nodes to a point field.
void extendPointField(Field& field, const std::vector<AddedNode>& added) {
    for (const AddedNode& node : added) {
        for (int c = 0; c < field.components; ++c) {
            double sum = 0;
            for (const std::int32_t parent : node.parents) sum += field.at(parent, c);
            field.values.push_back(sum / double(node.parents.size()));
        }
    }
}

void fillStatistics(const TetMesh& mesh, ImportStatistics& statistics, const Execution& execution) {
    const MeshQuality quality = measureQuality(mesh, execution);
    statistics.nodes = mesh.nodeCount();
    statistics.elements = mesh.elementCount();
    statistics.flat = quality.flat;
    statistics.inverted = quality.inverted;
    statistics.duplicate = quality.duplicate;
    statistics.coincidentNodes = quality.coincidentNodes;
    statistics.boundaryFaces = quality.boundaryFaces;
    statistics.nonConformingFaces = quality.nonConformingFaces;
    statistics.smallestEdgeWorld = quality.smallestEdgeWorld;
    statistics.largestEdgeWorld = quality.largestEdgeWorld;
    statistics.smallestVolumeWorld = quality.smallestVolumeWorld;
    statistics.largestVolumeWorld = quality.largestVolumeWorld;
}

bool isPureTets(const CellList& cells) {
    return std::all_of(cells.kinds.begin(), cells.kinds.end(),
                       [](CellKind kind) { return kind == CellKind::tet; });
}

}  // namespace

std::string meshName(const std::string& path, const ReadOptions& options) {
    const std::size_t others = options.otherParts.size();
    return others == 0
               ? path
               : path + " (and " + std::to_string(others) + (others == 1 ? " other part)" : " other parts)");
}

std::optional<std::string> allowedFolder(const std::string& path, const ReadOptions& options) {
    if (options.followsLinks) return std::nullopt;
    return folderOf(options.namedBy.empty() ? path : options.namedBy);
}

std::string cellFieldName(const std::string& name) {
    return name + "_cell";
}

bool isFieldCalled(const std::string& called, const std::string& name, FieldLocation location) {
    if (called == name) return true;
    if (location == FieldLocation::point) return called == "point:" + name;
    const std::string cell = "cell:";
    return called.starts_with(cell) &&
           (called.substr(cell.size()) == name || cellFieldName(called.substr(cell.size())) == name);
}

bool isWanted(const ReadOptions& options, const std::string& name, FieldLocation location) {
    if (options.fields.empty()) return true;
    const std::string plain = plainName(name);
    return std::any_of(options.fields.begin(), options.fields.end(), [&](const std::string& called) {
        return isFieldCalled(called, plain, location) ||
               (location == FieldLocation::cell && called == cellFieldName(plain));
    });
}

MeshFile assembleMesh(const std::string& path, RawMesh raw, const ReadOptions& options,
                      const Execution& execution) {
    const std::string name = meshName(path, options);
    ImportStatistics& statistics = raw.statistics;
    statistics.blocks = std::int64_t(raw.blocks.size());
    statistics.cells = 0;
    for (const RawBlock& block : raw.blocks) {
        statistics.cells += block.cellCount();
        statistics.cellsOfKind[std::size_t(CellKind::tet)] += std::int64_t(block.tets.size());
        for (const CellKind kind : block.cells.kinds) ++statistics.cellsOfKind[std::size_t(kind)];
    }
    if (statistics.cells == 0)
        throw InputError(
            name + ": has no 3D cells (" + std::to_string(statistics.skippedCells) +
            " others: points, lines, surfaces or unknown; " + std::to_string(statistics.blankedCells) +
            " blanked or ghost cells); tessera-tetrahedralize makes some of surfaces and points");
    RawBlock block = mergeBlocks(path, raw, options, execution);
    renameTwins(block, statistics);
    selectFields(name, block, options);
    warnSkippedArrays(block, statistics);

    MeshFile file;
    const bool pureTets = isPureTets(block.cells), isSplit = !block.tets.empty();
    SplitCells split;
    if (isSplit)
        split.tets = std::move(block.tets);
    else
        split = splitCells(block.points, block.cells, execution);
    if (std::int64_t(split.tets.size()) >= (std::int64_t(1) << 30))
        throw InputError(name + ": gives " + std::to_string(split.tets.size()) +
                         " tetrahedra; fewer than 2^30 are possible");
    file.mesh.points = std::move(block.points);
    for (const AddedNode& node : split.addedNodes) {
        if (!std::isfinite(node.point.x) || !std::isfinite(node.point.y) || !std::isfinite(node.point.z))
            throw InputError(name +
                             ": the centre of a cell isn't finite: its coordinates are too large to add");
        file.mesh.points.push_back(node.point);
    }
    statistics.addedNodes = std::int64_t(split.addedNodes.size());
    const bool everyCellIsItsTet = isSplit || (pureTets && split.tets.size() == block.cells.kinds.size());
    for (Field& field : block.fields) {
        if (field.location == FieldLocation::point)
            extendPointField(field, split.addedNodes);
        else if (!everyCellIsItsTet)
            gatherTuples(field, split.sourceCell, execution);
        file.mesh.fields.push_back(std::move(field));
    }
    file.mesh.tets = std::move(split.tets);
    if (file.mesh.tets.empty())
        throw InputError(name +
                         ": all cells are collapsed: none has four different nodes that span a tetrahedron");
    fillStatistics(file.mesh, statistics, execution);
    file.statistics = std::move(statistics);
    return file;
}

}  // namespace tessera
