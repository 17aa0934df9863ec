#pragma once

#include "job/job.h"
#include "job/resample_request.h"
#include "job/run_report.h"

namespace tessera {

/// Resamples a mesh, or every step of a series on one lattice, and writes a file for each. Returns the
/// document of docs/report.md. Nothing stands at an output's name until the file is whole. Throws InputError,
/// IoError, GlError and Cancelled.
Json resampleFiles(const ResampleRequest& request, Job& job);

}  // namespace tessera
