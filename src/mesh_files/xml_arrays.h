#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "files/xml_tags.h"

namespace tessera {

/// How a VTK XML file packs the values of its arrays.
struct XmlPacking {
    int headerBytes = 4;  ///< of a size in front of the values: 4 or 8
    bool bigEndian = false;
    bool compressed = false;
    std::optional<double> largestRatio = 1;  ///< of unpacked to packed bytes; nothing where there is no bound
    std::optional<std::size_t> appendedAt;   ///< byte behind the '_' that offsets count from
    std::size_t appendedEnd = 0;
    bool appendedIsBase64 = false;
};

/// From the attributes of <VTKFile>, and <AppendedData> when there is one.
/// @param appendedTag its byte; npos without one.
XmlPacking packingOf(InputFile& file, std::string_view root, std::size_t appendedTag);

/// Checks the sizes that stand in front of an array's values against the bytes that follow. Throws InputError
/// with the byte.
/// @param tag the array's <DataArray>.
void checkPackedArray(InputFile& file, const XmlTag& tag, const XmlPacking& packing);

}  // namespace tessera
