#pragma once

#include <string>

#include "job/focus_trace.h"

namespace tessera {

/// The keys of focusStepJson() as the header, then a line a step; a value that there is none of is empty.
std::string focusTraceCsv(const FocusTrace& trace);
/// What the mesh is, a table of the steps and what they add up to.
std::string focusTraceText(const FocusTraceRequest& request, const FocusTrace& trace, const Job& job);
/// "6 moves: better after 1.2 ms (median) and 8.1 ms (99 %), at rest after ...", without an end.
std::string focusSummaryText(const std::vector<FocusStep>& steps);

/// "9 places of points.txt in flow.vtu ...": the mesh, the algorithm, spacing, radius, threads, without an
/// end.
std::string focusTraceSetup(const FocusTraceRequest& request, const FocusTrace& trace, const Job& job);

/// "0.42", "12.3", "1,234".
std::string shortMilliseconds(double ms);
/// "0.13 %", "< 0.001 %".
std::string shareAsPercent(double share);

}  // namespace tessera
