#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "tessera/vec.h"

namespace tessera {

// What M. Weiler and T. Ertl, "Hardware-Software-Balanced Resampling for the Interactive Visualization of
// Unstructured Grids", IEEE Visualization 2001, measured on the bluntfin in figures 8 to 11: Athlon 900 MHz,
// GeForce2 GTS; without reading slices back. Their other data set, the heat-sink, is not public.

/// One row: seconds, and thousands of polygons. Absent: not given.
struct PaperRow {
    std::string_view paperName;  ///< "MultiComb", "Hybrid", "WestSingle", "WestM/C", "Software"
    std::string_view algorithm;  ///< ours that does the same; empty: none
    std::optional<double> aelSeconds, rndSeconds;
    double totSeconds = 0;
    std::optional<int> polygonsK;
};

struct PaperGrid {
    Vec3i points{0};
    std::vector<PaperRow> rows;
};

/// The bluntfin itself, or its mirrored multiples.
struct PaperDataSet {
    std::string_view prefix;      ///< "", "double ", "quad "
    std::string_view figures;     ///< "figures 9 and 11"
    int elementsK = 0;            ///< as the paper says
    std::vector<int> mirrorAxes;  ///< mirrored at a plane perpendicular to each, in turn
    std::vector<PaperGrid> grids;
};

std::span<const PaperDataSet> paperDataSets();

}  // namespace tessera
