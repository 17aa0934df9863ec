// Input: the error report of a VDB file, JSON.

#include <cstdint>
#include <string>
#include <string_view>

#include "base/check.h"
#include "fuzz_tools.h"
#include "vdb/report_json.h"

namespace tessera {
namespace {

void run(std::string_view input) {
    const ErrorReport report = reportFromJson(std::string(input));
    // A field has 16 keys, so its text is far longer than this.
    TESSERA_CHECK(report.fields.size() <= input.size() / 100, "no more fields than the text holds");
    const std::string text = reportToJson(report);
    TESSERA_CHECK(reportToJson(reportFromJson(text)) == text, "a report comes back");
}

}  // namespace
}  // namespace tessera

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    tessera::fuzz::expectInputErrorsOnly([&] { tessera::run({reinterpret_cast<const char*>(data), size}); });
    return 0;
}
