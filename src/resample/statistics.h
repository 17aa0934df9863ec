#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace tessera {

/// What one call of a resampler did: named counts, which are exact, and named stages in milliseconds of wall
/// clock, which may overlap. Each algorithm has its own.
class ResampleStatistics {
  public:
    template <class Value>
    struct Entry {
        std::string_view name;  ///< lives as long as the program
        Value value;
    };

    /// 0 for a name that wasn't added.
    std::int64_t count(std::string_view name) const;
    double ms(std::string_view stage) const;

    void add(std::string_view name, std::int64_t value);
    void addMs(std::string_view stage, double ms);
    void setMs(std::string_view stage, double ms);

    /// In the order in which they were added first.
    const std::vector<Entry<std::int64_t>>& counts() const { return counts_; }
    const std::vector<Entry<double>>& stages() const { return stages_; }

    ResampleStatistics& operator+=(const ResampleStatistics& other);

  private:
    std::vector<Entry<std::int64_t>> counts_;
    std::vector<Entry<double>> stages_;
};

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
inline constexpr std::string_view polygons =
    "polygons";  ///< substitute or slice polygons, before they are grown
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
