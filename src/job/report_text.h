#pragma once

#include <string>
#include <vector>

#include "job/predict_cost.h"
#include "job/run_report.h"
#include "job/table_text.h"
#include "refine/plan.h"

namespace tessera {

/// 1234567 -> "1,234,567".
std::string formatCount(std::int64_t count);
/// Bytes with a unit, e.g. "12.3 MB".
std::string formatBytes(std::int64_t bytes);

std::string importText(const std::string& path, const ImportStatistics& statistics, const Box3d& boundsWorld);
std::string stagesText(const StageTimes& times);
// Tables, which keep to a width in columns.
std::string fieldsText(const std::vector<FieldSummary>& fields, std::size_t width);
std::string levelsText(const std::vector<LevelSummary>& levels, std::size_t width);
std::string errorText(const ErrorReport& report, std::size_t width);
std::string estimateText(const PlanEstimate& estimate, const CostPrediction& cost, std::size_t width);

}  // namespace tessera
