#include "vdb/output_formats.h"

#include <array>

#include "vdb/nvdb_write.h"
#include "vdb/vdb_write.h"
#include "vdb/vti_write.h"

namespace tessera {

std::span<const OutputFormat> outputFormats() {
    static const std::array<OutputFormat, 3> formats{
        OutputFormat{"vdb", "OpenVDB", true, [](const VdbWriteOptions&) {}, writeVdb},
        OutputFormat{"nvdb", "NanoVDB", false, checkNvdbOptions, writeNvdb},
        OutputFormat{"vti", "VTK image data", false, checkVtiOptions, writeVti}};
    return formats;
}

}  // namespace tessera
