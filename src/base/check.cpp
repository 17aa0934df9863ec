#include "base/check.h"

#include "tessera/error.h"

namespace tessera {

void throwInternalError(const char* condition, const char* file, int line, const std::string& note) {
    throw InternalError(std::string(file) + ":" + std::to_string(line) + ": check failed: " + condition +
                        ": " + note);
}

}  // namespace tessera
