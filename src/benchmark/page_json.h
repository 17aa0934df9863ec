#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "job/run_report.h"

namespace tessera {

// Reading a document that may lack any part: what is missing, null or of another kind is simply not there.

/// The part of that name, or null.
const Json& partOf(const Json& json, std::string_view key);
/// The same several levels down.
template <class... Keys>
const Json& partOf(const Json& json, std::string_view key, Keys... keys) {
    return partOf(partOf(json, key), keys...);
}
/// The entries of a list; none if it is no list.
const Json::array_t& entriesOf(const Json& json);
/// A finite number.
std::optional<double> numberOf(const Json& json);
/// A text, empty if it is none.
std::string wordsOf(const Json& json);
bool isTrue(const Json& json);

/// A median with its interval, which is the median itself where there is none. Milliseconds, or a ratio.
struct PageTime {
    double median = 0, low = 0, high = 0;
    int count = 0;
};
std::optional<PageTime> pageTimeOf(const Json& json);

}  // namespace tessera
