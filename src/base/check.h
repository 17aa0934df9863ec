#pragma once

#include <string>

namespace tessera {

[[noreturn]] void throwInternalError(const char* condition, const char* file, int line,
                                     const std::string& note);

}  // namespace tessera

/// Always on: throws InternalError with the place when `condition` is false.
#define TESSERA_CHECK(condition, note) \
    ((condition) ? void(0) : ::tessera::throwInternalError(#condition, __FILE__, __LINE__, (note)))
