#pragma once

#include <string>
#include <vector>

#include "compare/compare_resamplers.h"
#include "job/run_report.h"

namespace tessera {

/// The report of one mesh as tables that keep to a width in columns.
std::string compareText(const CompareReport& report, std::size_t width);
/// One sentence for each way in which the algorithms do not agree; empty when they do.
std::vector<std::string> disagreements(const CompareReport& report);

/// A table for a page of documentation: its head, then the rows of one mesh, one an algorithm.
std::string markdownHead();
std::string markdownRows(const std::string& mesh, const CompareReport& report);

Json compareJson(const CompareReport& report);

/// "128 x 64 x 32".
std::string formatGrid(const Vec3i& points);

}  // namespace tessera
