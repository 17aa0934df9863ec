#pragma once

#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>

#include "tessera/error.h"

namespace tessera {

/// Parses JSON that is nested no deeper than ours: the library copies what it has read in recursion, so a
/// deep text would end the process. Throws InputError, and Json::exception for what isn't JSON.
template <class Json>
Json parseJson(const std::string& text) {
    constexpr int kDeepest = 32;
    return Json::parse(text, [](int depth, typename Json::parse_event_t, Json&) {
        if (depth > kDeepest) throw InputError("damaged: JSON nested more than 32 deep");
        return true;
    });
}

/// A whole number that fits the type. The library's own conversion wraps what is too large and cuts off a
/// fraction. Throws InputError, which calls the number `name`, for these and for anything that isn't a
/// number.
template <class Integer, class Json>
Integer readInteger(const Json& json, const std::string& name) {
    using Limits = std::numeric_limits<Integer>;
    static_assert(std::is_signed_v<Integer> && sizeof(Integer) <= sizeof(std::int64_t));
    bool fits = false;
    if (json.is_number_unsigned())
        fits = json.template get<std::uint64_t>() <= std::uint64_t(Limits::max());
    else if (json.is_number_integer())
        fits = json.template get<std::int64_t>() >= std::int64_t(Limits::min());
    if (!fits)
        throw InputError("damaged: " + name + " is " + (json.is_number() ? json.dump() : json.type_name()) +
                         ", expected a whole number that isn't too large");
    return json.template get<Integer>();
}

}  // namespace tessera
