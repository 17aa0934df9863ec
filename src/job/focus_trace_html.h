#pragma once

#include <string>

#include "job/focus_trace.h"

namespace tessera {

/// One page that needs no other file and no script: what was measured, two plots over the steps (times and
/// memory) and a table of all steps.
std::string focusTraceHtml(const FocusTraceRequest& request, const FocusTrace& trace, const Job& job);

}  // namespace tessera
