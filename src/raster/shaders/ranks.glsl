// As src/raster/point_scan.h ranks the elements of a region: a kind in the highest bits.
const uint kKindShift = 28u;
const uint kPlaceMask = (1u << kKindShift) - 1u;
const uint kNoBox = ~0u;  // in place of a rank
