#include "job/focus_trace_text.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "job/report_text.h"
#include "job/table_text.h"

namespace tessera {

namespace {

constexpr const char* kNothing = "-";

std::string csvCell(const Json& value) {
    return value.is_null() ? std::string() : value.dump();
}

std::string twoTimes(const TimeFigures& figures) {
    return fmt::format("{} ms (median) and {} ms (99 %)", shortMilliseconds(figures.medianMs),
                       shortMilliseconds(figures.p99Ms));
}

std::string stepsTable(const FocusTrace& trace, std::size_t width) {
    TableRows rows{{"step", "better ms", "rest ms", "sampled", "reused", "dropped", "leaves", "memory",
                    "largest error", "RMS", "nodes", "spacing", "voxels"}};
    for (std::size_t i = 0; i < trace.steps.size(); ++i) {
        const FocusStep& s = trace.steps[i];
        const bool compared = s.error.nodes > 0;
        rows.push_back({std::to_string(i + 1),
                        !s.moved     ? "jitter"
                        : s.betterMs ? shortMilliseconds(*s.betterMs)
                                     : kNothing,
                        shortMilliseconds(s.restMs), formatCount(s.sampled), formatCount(s.reused),
                        formatCount(s.dropped), formatCount(s.leaves), formatBytes(s.bytes),
                        compared ? shareAsPercent(s.error.relativeMax) : kNothing,
                        compared ? shareAsPercent(s.error.relativeRms) : kNothing, formatCount(s.error.nodes),
                        s.spacingWorld ? fmt::format("{:.4g}", *s.spacingWorld) : kNothing,
                        formatCount(s.voxels)});
    }
    return formatTable(rows, width, {.keys = 1, .glued = "RMS"});
}

}  // namespace

std::string shortMilliseconds(double ms) {
    return ms >= 999.5 ? formatCount(std::int64_t(std::llround(ms)))
                       : fmt::format("{:.{}f}", ms,
                                     ms >= 99.95   ? 0
                                     : ms >= 9.995 ? 1
                                                   : 2);
}

std::string shareAsPercent(double share) {
    constexpr double kLeast = 1e-5;
    return share > 0 && share < kLeast ? fmt::format("< {:g} %", kLeast * 100)
                                       : fmt::format("{:.2g} %", share * 100);
}

std::string focusTraceCsv(const FocusTrace& trace) {
    std::string text;
    for (std::size_t i = 0; i < trace.steps.size(); ++i) {
        const Json step = focusStepJson(trace.steps[i], i + 1);
        std::string header, line;
        for (const auto& [key, value] : step.items()) {
            if (!header.empty()) header += ',', line += ',';
            header += key;
            line += csvCell(value);
        }
        if (i == 0) text += header + '\n';
        text += line + '\n';
    }
    return text;
}

std::string focusSummaryText(const std::vector<FocusStep>& steps) {
    const FocusStep& first = steps.front();
    const FocusSummary summary = summarize(steps);
    std::string text = fmt::format("from nothing at rest after {} ms", shortMilliseconds(first.restMs));
    if (summary.moves > 0) {
        text += fmt::format("; {} moves: ", formatCount(std::int64_t(summary.moves)));
        if (summary.better.count > 0)
            text += fmt::format("{}better after {}, ",
                                summary.better.count == summary.moves
                                    ? ""
                                    : formatCount(std::int64_t(summary.better.count)) + " of them ",
                                twoTimes(summary.better));
        text += "at rest after " + twoTimes(summary.rest);
    }
    if (summary.tooSmall > 0)
        text += fmt::format("; {} too small to change anything", formatCount(std::int64_t(summary.tooSmall)));
    return text;
}

std::string focusTraceSetup(const FocusTraceRequest& request, const FocusTrace& trace, const Job& job) {
    const int threads = job.execution.threadCount();
    return fmt::format(
        "{} places of {} in {} ({} elements), sampled by {} on {} thread{}, finest spacing {:.4g}, radius "
        "{:.4g}, "
        "updates of {:g} ms, at most {} of bricks",
        formatCount(std::int64_t(trace.steps.size())),
        std::filesystem::path(request.path).filename().string(),
        std::filesystem::path(request.input).filename().string(), formatCount(trace.file.mesh.elementCount()),
        trace.algorithm, threads, threads == 1 ? "" : "s", trace.finestSpacingWorld, request.radiusWorld,
        request.frameMs, formatBytes(request.budgetBytes));
}

std::string focusTraceText(const FocusTraceRequest& request, const FocusTrace& trace, const Job& job) {
    std::string text = importText(request.input, trace.file.statistics, trace.file.boundsWorld);
    text += fmt::format("  {}\n", focusTraceSetup(request, trace, job));
    text +=
        trace.errorField.empty()
            ? "  no error: no field has values at nodes\n"
            : fmt::format("  errors: of {} at the nodes near the focus, over its range\n", trace.errorField);
    text += stepsTable(trace, job.textWidth);
    text += focusSummaryText(trace.steps) + "\n";
    if (!request.output.empty())
        text += fmt::format("{}: {} steps\n", request.output, formatCount(std::int64_t(trace.steps.size())));
    return text;
}

}  // namespace tessera
