#include "benchmark/page_json.h"

#include <algorithm>
#include <cmath>

namespace tessera {

const Json& partOf(const Json& json, std::string_view key) {
    static const Json kNothing;
    if (!json.is_object()) return kNothing;
    const auto found = json.find(std::string(key));
    return found == json.end() ? kNothing : *found;
}

const Json::array_t& entriesOf(const Json& json) {
    static const Json::array_t kNone;
    return json.is_array() ? json.get_ref<const Json::array_t&>() : kNone;
}

std::optional<double> numberOf(const Json& json) {
    if (!json.is_number()) return {};
    const auto value = json.get<double>();
    return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

std::string wordsOf(const Json& json) {
    return json.is_string() ? json.get<std::string>() : std::string();
}

bool isTrue(const Json& json) {
    return json.is_boolean() && json.get<bool>();
}

std::optional<PageTime> pageTimeOf(const Json& json) {
    const auto median = numberOf(partOf(json, "median"));
    if (!median) return {};
    return PageTime{*median, std::min(*median, numberOf(partOf(json, "low")).value_or(*median)),
                    std::max(*median, numberOf(partOf(json, "high")).value_or(*median)),
                    int(std::clamp(numberOf(partOf(json, "count")).value_or(0), 0.0, 1e9))};
}

}  // namespace tessera
