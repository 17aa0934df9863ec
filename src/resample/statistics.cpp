#include "tessera/statistics.h"

#include <algorithm>

namespace tessera {

namespace {

template <class Entries>
auto* find(Entries& entries, std::string_view name) {
    const auto at =
        std::find_if(entries.begin(), entries.end(), [&](const auto& e) { return e.name == name; });
    return at == entries.end() ? nullptr : &*at;
}

template <class Value>
Value& at(std::vector<ResampleStatistics::Entry<Value>>& entries, std::string_view name) {
    if (auto* entry = find(entries, name)) return entry->value;
    entries.push_back({name, Value(0)});
    return entries.back().value;
}

}  // namespace

std::int64_t ResampleStatistics::count(std::string_view name) const {
    const auto* entry = find(counts_, name);
    return entry ? entry->value : 0;
}

double ResampleStatistics::ms(std::string_view stage) const {
    const auto* entry = find(stages_, stage);
    return entry ? entry->value : 0;
}

void ResampleStatistics::add(std::string_view name, std::int64_t value) {
    at(counts_, name) += value;
}

void ResampleStatistics::addMs(std::string_view stage, double ms) {
    at(stages_, stage) += ms;
}

void ResampleStatistics::setMs(std::string_view stage, double ms) {
    at(stages_, stage) = ms;
}

ResampleStatistics& ResampleStatistics::operator+=(const ResampleStatistics& other) {
    for (const auto& [name, value] : other.counts_) add(name, value);
    for (const auto& [name, value] : other.stages_) addMs(name, value);
    return *this;
}

}  // namespace tessera
