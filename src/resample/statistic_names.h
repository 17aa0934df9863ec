#pragma once

#include <string_view>

namespace tessera {

/// Names of counts, as in reports.
namespace counted {
inline constexpr std::string_view elementsNear =
    "elements_near";  ///< looked at: all, or those near the boxes
inline constexpr std::string_view elementBlockPairs =
    "element_block_pairs";  ///< elements that may touch a block or region, summed over them
inline constexpr std::string_view exactElements =
    "exact_elements";  ///< of these, pairs that needed more than double precision
inline constexpr std::string_view scanlines = "scanlines";         ///< visited
inline constexpr std::string_view contested = "contested_points";  ///< that more than one element covered
inline constexpr std::string_view coveredPoints = "covered_points";
inline constexpr std::string_view elementSlicePairs =
    "element_slice_pairs";  ///< slices that an element reaches, summed over elements
inline constexpr std::string_view polygons = "polygons";    ///< substitute or slice polygons, before they are
                                                            ///< grown; on the processor slicing's triangles
inline constexpr std::string_view vertices = "vertices";    ///< sent to the device
inline constexpr std::string_view fragments = "fragments";  ///< shaded, as the device counts them
inline constexpr std::string_view uploadBytes = "upload_bytes";
inline constexpr std::string_view readBackBytes = "read_back_bytes";
}  // namespace counted

/// Names of stages, as in reports.
namespace stage {
inline constexpr std::string_view bin = "bin_ms";            ///< element lists
inline constexpr std::string_view sample = "sample_ms";      ///< everything after, the sink included
inline constexpr std::string_view generate = "generate_ms";  ///< polygons or instances, on the processor
inline constexpr std::string_view upload = "upload_ms";
inline constexpr std::string_view render = "render_ms";  ///< on the device, by timer queries
inline constexpr std::string_view readBack = "read_back_ms";
}  // namespace stage

}  // namespace tessera
