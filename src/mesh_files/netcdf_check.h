#pragma once

#include <string>

namespace tessera {

/// Throws InputError when a NetCDF file of the classic formats (CDF-1, 2, 5) is shorter than its variables:
/// the NetCDF library reads zeros there. Other files pass.
/// Source: "The NetCDF Classic Format Specification", Unidata.
void checkNetcdfSize(const std::string& path);

}  // namespace tessera
