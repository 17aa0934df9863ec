#pragma once

#include "benchmark/benchmark_request.h"
#include "job/job.h"
#include "job/run_report.h"

namespace tessera {

/// What accuracy costs in time, for one field of one mesh on this machine: every algorithm in all its ways,
/// and peers, over resolutions and criteria, in rounds of random order; errors of the reconstruction, of the
/// pictures, and of the samples against exact arithmetic. Writes a folder: index.html, report.json, runs.csv,
/// oracle.csv, and the plots as SVG files in plots/. Returns the document of report.json, which holds every
/// number on the page. Throws InputError, IoError and Cancelled; an algorithm that fails is left out with its
/// reason.
Json runBenchmark(const BenchmarkRequest& request, Job& job);

}  // namespace tessera
