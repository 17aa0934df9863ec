#include "job/run_report.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "refine/plan.h"
#include "vdb/report_json.h"

namespace tessera {

namespace {

Json cellTypesJson(const ImportStatistics& s) {
    const auto count = [&](CellKind kind) { return s.cellsOfKind[std::size_t(kind)]; };
    return {{"tetrahedra", count(CellKind::tet)}, {"pyramids", count(CellKind::pyramid)},
            {"wedges", count(CellKind::wedge)},   {"hexahedra", count(CellKind::hex)},
            {"voxels", count(CellKind::voxel)},   {"polyhedra", count(CellKind::polyhedron)}};
}

}  // namespace

StageTimes& StageTimes::operator+=(const StageTimes& other) {
    readMs += other.readMs;
    planMs += other.planMs;
    resampleMs += other.resampleMs;
    verifyMs += other.verifyMs;
    extendMs += other.extendMs;
    writeMs += other.writeMs;
    return *this;
}

std::vector<LevelSummary> summarizeLevels(const BrickTree& tree, const BrickStore& store) {
    std::vector<LevelSummary> levels(std::size_t(tree.levelCount()));
    const std::int64_t brickPoints = std::int64_t(tree.brickCells()) * tree.brickCells() * tree.brickCells();
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        LevelSummary& level = levels[std::size_t(tree.leaves()[leaf].level)];
        ++level.bricks;
        level.storedPoints += brickPoints;
        if (store.leafCount() == 0) continue;
        for (int t = 0; t < store.tileCount(); ++t)
            if (const Tile* tile = store.tile(leaf, t))
                for (const std::uint64_t word : tile->coverage) level.coveredPoints += std::popcount(word);
    }
    for (std::size_t l = 0; l < levels.size(); ++l) {
        levels[l].level = int(l);
        levels[l].spacingWorld = tree.spacingWorld(int(l));
    }
    return levels;
}

std::vector<FieldSummary> summarizeFields(const TetMesh& mesh) {
    std::vector<FieldSummary> summaries;
    for (const Field& field : mesh.fields) {
        FieldSummary summary{field.name, field.location == FieldLocation::point ? "point" : "cell", {}};
        for (int c = 0; c < field.components; ++c) summary.ranges.push_back(fieldRange(field, c));
        summaries.push_back(std::move(summary));
    }
    return summaries;
}

Json documentHead(const std::string& command) {
    return {{"schema", 1}, {"program", "tessera"}, {"version", TESSERA_VERSION}, {"command", command}};
}

Json vectorJson(const Vec3d& v) {
    return Json::array({v.x, v.y, v.z});
}

Json rangeJson(const ValueRange& range) {
    return range.empty() ? Json(nullptr) : Json::array({range.min, range.max});
}

Json fieldsJson(const std::vector<FieldSummary>& fields) {
    Json list = Json::array();
    for (const FieldSummary& field : fields) {
        Json ranges = Json::array();
        for (const ValueRange& range : field.ranges) ranges.push_back(rangeJson(range));
        list.push_back({{"name", field.name},
                        {"location", field.location},
                        {"components", field.ranges.size()},
                        {"ranges", ranges}});
    }
    return list;
}

Json meshJson(const ImportStatistics& s, const Box3d& bounds, const std::vector<FieldSummary>& fields) {
    Json json{{"format", s.format},
              {"nodes", s.nodes},
              {"elements", s.elements},
              {"cells", s.cells},
              {"cell_types", cellTypesJson(s)},
              {"skipped_cells", s.skippedCells},
              {"blanked_cells", s.blankedCells},
              {"higher_order_cells", s.higherOrderCells},
              {"blocks", s.blocks},
              {"added_nodes", s.addedNodes},
              {"flat_elements", s.flat},
              {"inverted_elements", s.inverted},
              {"duplicate_elements", s.duplicate},
              {"coincident_nodes", s.coincidentNodes},
              {"boundary_faces", s.boundaryFaces},
              {"non_conforming_faces", s.nonConformingFaces},
              {"edge_range", {s.smallestEdgeWorld, s.largestEdgeWorld}},
              {"volume_range", {s.smallestVolumeWorld, s.largestVolumeWorld}},
              {"bounds", {vectorJson(bounds.min), vectorJson(bounds.max)}},
              {"fields", fieldsJson(fields)},
              {"warnings", s.warnings}};
    if (!s.notes.empty()) json["notes"] = s.notes;
    return json;
}

Json levelsJson(const BrickTree& tree, const std::vector<LevelSummary>& levels) {
    Json bricks = Json::array(), stored = Json::array(), covered = Json::array(), spacings = Json::array();
    std::int64_t allStored = 0, allCovered = 0;
    for (const LevelSummary& level : levels) {
        bricks.push_back(level.bricks);
        stored.push_back(level.storedPoints);
        covered.push_back(level.coveredPoints);
        spacings.push_back(level.spacingWorld);
        allStored += level.storedPoints;
        allCovered += level.coveredPoints;
    }
    return {{"lattice",
             {{"origin", vectorJson(tree.originWorld())},
              {"spacing", tree.spacingWorld()},
              {"brick_cells", tree.brickCells()},
              {"levels", tree.levelCount()},
              {"spacing_per_level", spacings}}},
            {"bricks", {{"total", tree.leafCount()}, {"per_level", bricks}}},
            {"voxels",
             {{"total", allStored},
              {"per_level", stored},
              {"covered_total", allCovered},
              {"covered_per_level", covered}}}};
}

Json coverageJson(const ErrorReport& report) {
    Json json = Json::parse(reportToJson(report));
    json.erase("fields");
    return json;
}

Json errorJson(const ErrorReport& report) {
    Json json = Json::object();
    Json whole = Json::parse(reportToJson(report));
    for (Json& field : whole["fields"]) {
        const std::string name = field["name"];
        field.erase("name");
        json[name] = std::move(field);
    }
    return json;
}

Json stagesJson(const StageTimes& t) {
    return {{"read", t.readMs},     {"plan", t.planMs},     {"resample", t.resampleMs},
            {"verify", t.verifyMs}, {"extend", t.extendMs}, {"write", t.writeMs}};
}

Json statisticsJson(const ResampleStatistics& statistics) {
    Json json = Json::object();
    for (const auto& [name, value] : statistics.counts()) json[std::string(name)] = value;
    for (const auto& [name, ms] : statistics.stages()) json[std::string(name)] = ms;
    return json;
}

Json writeResultJson(const VdbWriteResult& w, int flatLevel) {
    return {{"active_voxels", w.activeVoxels},
            {"file_bytes", w.fileBytes},
            {"flat_level", flatLevel},
            {"unit_scale", w.unitScale},
            {"notes", w.notes}};
}

Json estimateJson(const PlanEstimate& e, const CostPrediction& cost) {
    return {
        {"bricks_per_level", e.bricksPerLevel},
        {"levels", {{"voxels", e.storedPoints}, {"bytes", e.levelsBytes}, {"predicted_ms", cost.levelsMs}}},
        {"flat", {{"voxels", e.flatPoints}, {"bytes", e.flatBytes}, {"predicted_ms", cost.flatMs}}}};
}

std::string documentText(const Json& document) {
    // Field names come from files and need not be UTF-8.
    return document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace tessera
