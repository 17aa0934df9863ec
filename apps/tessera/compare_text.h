#pragma once

#include <string>
#include <vector>

#include "compare/compare_resamplers.h"
#include "run_report.h"

namespace tessera {

/// The report of one mesh as tables for a terminal.
std::string compareText(const CompareReport& report);
/// One sentence for each way in which the algorithms do not agree; empty when they do.
std::vector<std::string> disagreements(const CompareReport& report);

/// A table for a page of documentation: its head, then the rows of one mesh, one an algorithm.
std::string markdownHead();
std::string markdownRows(const std::string& mesh, const CompareReport& report);

Json compareJson(const CompareReport& report);

/// "128 x 64 x 32".
std::string formatGrid(const Vec3i& points);

}  // namespace tessera
