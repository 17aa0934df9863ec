#include "files/name_list.h"

#include <cstddef>

namespace tessera {

namespace {
constexpr std::size_t kMostNames = 8;
}

std::string nameList(const std::vector<std::string>& names) {
    std::string text;
    // One more name takes no more room than the words that would stand for it.
    const std::size_t shown = names.size() <= kMostNames + 1 ? names.size() : kMostNames;
    for (std::size_t i = 0; i < shown; ++i) text += (i == 0 ? "" : ", ") + names[i];
    if (shown < names.size()) text += " and " + std::to_string(names.size() - shown) + " more";
    return text;
}

}  // namespace tessera
