#pragma once

#include <string>

#include "job/job.h"
#include "job/run_report.h"
#include "tessera/resampler.h"

namespace tessera {

/// What `tessera paper-tables` is asked for.
struct PaperTablesRequest {
    std::string mesh;          ///< the paper's is the bluntfin
    std::string field;         ///< empty: the first scalar field of the points
    BindOptions bind;          ///< of the algorithms that have a choice
    int runs = 3;              ///< of each algorithm; times are medians
    int maxSize = 1024;        ///< leaves out grids with more points along an axis
    bool asPublished = false;  ///< times the methods as they were published
};

/// Times the algorithms on the grids of the paper that they come from and says its tables beside. Returns the
/// document. Throws InputError and GlError.
Json makePaperTables(const PaperTablesRequest& request, Job& job);

}  // namespace tessera
