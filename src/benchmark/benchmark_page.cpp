#include "benchmark/benchmark_page.h"

namespace tessera {

std::string benchmarkPage(const Json& document) {
    return document.dump();
}

}  // namespace tessera
