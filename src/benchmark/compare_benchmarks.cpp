#include "benchmark/compare_benchmarks.h"

#include "files/input_file.h"
#include "files/json_parse.h"
#include "tessera/error.h"

namespace tessera {

Json readBenchmark(const std::string& path) {
    return parseJson<Json>(readWholeFile(path));
}

Json compareBenchmarks(const Json&, const Json&) {
    return {{"sentences", Json::array()}};
}

}  // namespace tessera
