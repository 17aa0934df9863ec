#pragma once

#include <string>
#include <vector>

#include "run_report.h"
#include "table_text.h"

#include "refine/plan.h"

namespace tessera {

/// 1234567 -> "1,234,567".
std::string formatCount(std::int64_t count);
/// Bytes with a unit, e.g. "12.3 MB".
std::string formatBytes(std::int64_t bytes);
/// Names in a file may hold what a terminal obeys: control characters become spaces, but for line ends.
std::string withoutControls(std::string text);
/// The same with line ends as spaces too, and no space at the end.
std::string singleLine(std::string text);

std::string importText(const std::string& path, const ImportStatistics& statistics, const Box3d& boundsWorld);
std::string fieldsText(const std::vector<FieldSummary>& fields);
std::string levelsText(const std::vector<LevelSummary>& levels);
std::string errorText(const ErrorReport& report);
std::string stagesText(const StageTimes& times);
std::string estimateText(const PlanEstimate& estimate, double levelsMs, double flatMs);

}  // namespace tessera
