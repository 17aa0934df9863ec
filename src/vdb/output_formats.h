#pragma once

#include <span>
#include <string>
#include <vector>

#include "refine/brick_result.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// A kind of file that bricks are written to.
struct OutputFormat {
    const char* name = "";     ///< "vdb": the ending of its files without the dot
    const char* title = "";    ///< as people call it
    bool holdsLevels = false;  ///< it can hold a grid a level; else only the flat layout
    /// Throws InputError, naming the option of the command line, for options that the format can't follow.
    void (*check)(const VdbWriteOptions& options) = nullptr;
    /// As writeVdb.
    VdbWriteResult (*write)(const std::string& path, const std::vector<OutputField>& fields,
                            BrickResult& result, const VdbWriteOptions& options,
                            const Execution& execution) = nullptr;
};

/// All there are, the default first.
std::span<const OutputFormat> outputFormats();

}  // namespace tessera
