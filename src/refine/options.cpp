#include "tessera/options.h"

#include <string>
#include <utility>

namespace tessera {

std::string nameOf(Criteria criteria) {
    std::string names;
    for (const auto& [criterion, name] : {std::pair{Criterion::uniform, "uniform"},
                                          {Criterion::elementSize, "element-size"},
                                          {Criterion::error, "error"},
                                          {Criterion::focus, "focus"},
                                          {Criterion::visibility, "visibility"}}) {
        if (!criteria.has(criterion)) continue;
        if (!names.empty()) names += ',';
        names += name;
    }
    return names;
}

}  // namespace tessera
