#include "job/series_steps.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "mesh/field_range.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kWidthDigits = 2;

[[noreturn]] void refuseTimes(const std::string& text) {
    throw InputError(fmt::format("--times: expected a:b, a: or :b with numbers a <= b, got '{}'", text));
}

std::optional<double> parseBound(const std::string& text, std::string_view bound) {
    if (bound.empty()) return std::nullopt;
    double value = 0;
    const auto [end, failure] = std::from_chars(bound.data(), bound.data() + bound.size(), value);
    if (failure != std::errc{} || end != bound.data() + bound.size() || !std::isfinite(value))
        refuseTimes(text);
    return value;
}

/// The number as printf's format between '%' and 'd' has it: "", "4" or "04".
std::string paddedNumber(std::string_view width, std::size_t number) {
    std::string text = std::to_string(number);
    std::size_t least = 0;
    std::from_chars(width.data(), width.data() + width.size(), least);
    if (text.size() < least) text.insert(0, least - text.size(), width.starts_with('0') ? '0' : ' ');
    return text;
}

/// Replaces the longest run of #, the last of equal ones, by at least as many digits.
void numberHashes(std::string& name, std::size_t number) {
    std::size_t begin = 0, length = 0;
    for (std::size_t at = name.find('#'); at != std::string::npos;) {
        const std::size_t end = std::min(name.find_first_not_of('#', at), name.size());
        if (end - at >= length) begin = at, length = end - at;
        at = name.find('#', end);
    }
    if (length > 0) name.replace(begin, length, fmt::format("{:0{}}", number, length));
}

bool isSame(const FieldSummary& a, const FieldSummary& b) {
    return a.name == b.name && a.location == b.location;
}

void widen(std::vector<ValueRange>& ranges, const std::vector<ValueRange>& more) {
    for (std::size_t c = 0; c < std::min(ranges.size(), more.size()); ++c) {
        ranges[c].min = std::min(ranges[c].min, more[c].min);
        ranges[c].max = std::max(ranges[c].max, more[c].max);
    }
}

}  // namespace

std::string nameOf(const SeriesStep& step) {
    if (step.files.size() == 1) return step.files[0];
    return fmt::format("{}{}, {} parts", step.collection,
                       step.time ? fmt::format(" at time {}", *step.time) : std::string(), step.files.size());
}

SeriesStep chosenStep(const std::string& collection, int number) {
    const std::vector<SeriesStep> steps = listSeries(std::span(&collection, 1));
    if (number >= int(steps.size()))
        throw InputError(fmt::format("{}: there is no time step {}; it has {}, counted from 0", collection,
                                     number, steps.size()));
    return number < 0 ? steps.back() : steps[std::size_t(number)];
}

ReadOptions readOptions(const SeriesStep& step, std::vector<std::string> fields, int timeStep) {
    ReadOptions options{std::move(fields), timeStep, {step.files.begin() + 1, step.files.end()}};
    options.namedBy = step.collection;
    return options;
}

TimeRange parseTimes(const std::string& text) {
    const std::size_t colon = text.find(':');
    if (colon == std::string::npos || text.size() == 1) refuseTimes(text);
    const std::string_view whole = text;
    const TimeRange range{parseBound(text, whole.substr(0, colon)),
                          parseBound(text, whole.substr(colon + 1))};
    if (range.first && range.last && *range.first > *range.last) refuseTimes(text);
    return range;
}

std::string numberedName(const std::string& pattern, std::size_t number) {
    std::string name;
    bool isNumbered = false;
    for (std::size_t at = 0; at < pattern.size(); ++at) {
        if (pattern[at] != '%') {
            name += pattern[at];
            continue;
        }
        const std::size_t end = std::min(pattern.find_first_not_of("0123456789", at + 1), pattern.size());
        const std::string width = pattern.substr(at + 1, end - at - 1);
        const char type = end < pattern.size() ? pattern[end] : '\0';
        if (type == 'd' && width.size() <= kWidthDigits) {
            name += paddedNumber(width, number);
            isNumbered = true;
        } else if (type == '%' && width.empty()) {
            name += '%';
        } else {
            throw InputError(
                fmt::format("{}: an output's name can't hold '{}': %d and %04d stand for the step's number, "
                            "as #### does, "
                            "and %% for a percent sign",
                            pattern, pattern.substr(at, end + 1 - at)));
        }
        at = end;
    }
    if (!isNumbered) numberHashes(name, number);
    return name;
}

bool takesNumber(const std::string& pattern) {
    return numberedName(pattern, 0) != numberedName(pattern, 1);
}

Json stepJson(const SeriesStep& step) {
    Json json{{"step", step.number}};
    if (step.time) json["time"] = *step.time;
    if (step.files.size() > 1) json["files"] = step.files;
    return json;
}

void SeriesSummary::add(const SeriesStep& step, const TetMesh& mesh) {
    times_.push_back(step.time);
    boundsWorld_.include(mesh.boundsWorld());
    for (FieldSummary& field : summarizeFields(mesh)) {
        const auto same = std::find_if(fields_.begin(), fields_.end(),
                                       [&](const FieldSummary& other) { return isSame(other, field); });
        if (same == fields_.end()) {
            fields_.push_back(std::move(field));
            stepsWith_.push_back(1);
        } else {
            widen(same->ranges, field.ranges);
            ++stepsWith_[std::size_t(same - fields_.begin())];
        }
    }
}

std::vector<std::string> SeriesSummary::notes() const {
    std::vector<std::string> notes;
    for (std::size_t f = 0; f < fields_.size(); ++f)
        if (stepsWith_[f] < times_.size())
            notes.push_back(fmt::format("field '{}' is in {} of {} steps only", fields_[f].name,
                                        stepsWith_[f], times_.size()));
    return notes;
}

Json SeriesSummary::json() const {
    Json json{{"steps", times_.size()}};
    if (std::any_of(times_.begin(), times_.end(), [](const auto& time) { return time.has_value(); }))
        for (const std::optional<double>& time : times_)
            json["times"].push_back(time ? Json(*time) : Json(nullptr));
    json["bounds"] = {vectorJson(boundsWorld_.min), vectorJson(boundsWorld_.max)};
    json["fields"] = fieldsJson(fields_);
    return json;
}

}  // namespace tessera
