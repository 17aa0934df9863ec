#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "job/predict_cost.h"
#include "mesh/field_range.h"
#include "mesh_files/read_mesh.h"
#include "refine/plan.h"
#include "refine/refine.h"
#include "vdb/vdb_file.h"

namespace tessera {

using Json = nlohmann::ordered_json;

/// Wall milliseconds of one run, stage by stage.
struct StageTimes {
    double readMs = 0, planMs = 0, resampleMs = 0, verifyMs = 0, extendMs = 0, writeMs = 0;
    StageTimes& operator+=(const StageTimes& other);
};

/// What one level of the output holds.
struct LevelSummary {
    int level = 0;
    double spacingWorld = 0;
    std::int64_t bricks = 0;
    std::int64_t storedPoints = 0;   ///< bricks x B^3
    std::int64_t coveredPoints = 0;  ///< of these, in the mesh
};
std::vector<LevelSummary> summarizeLevels(const BrickTree& tree, const BrickStore& store);

/// Finite range of one component of one field.
struct FieldSummary {
    std::string name, location;
    std::vector<ValueRange> ranges;  ///< one a component
};
std::vector<FieldSummary> summarizeFields(const TetMesh& mesh);

/// What every document begins with. @param command "resample".
Json documentHead(const std::string& command);
Json vectorJson(const Vec3d& v);
Json rangeJson(const ValueRange& range);
Json fieldsJson(const std::vector<FieldSummary>& fields);
Json meshJson(const ImportStatistics& statistics, const Box3d& boundsWorld,
              const std::vector<FieldSummary>& fields);
Json levelsJson(const BrickTree& tree, const std::vector<LevelSummary>& levels);
/// Counts of covered points and of samples.
Json coverageJson(const ErrorReport& report);
/// One entry a field, by name.
Json errorJson(const ErrorReport& report);
Json stagesJson(const StageTimes& times);
Json statisticsJson(const ResampleStatistics& statistics);
/// @param flatLevel BrickResult::flatLevel.
Json writeResultJson(const VdbWriteResult& written, int flatLevel);
Json estimateJson(const PlanEstimate& estimate, const CostPrediction& cost);

/// The document as the bytes of a file.
std::string documentText(const Json& document);

}  // namespace tessera
