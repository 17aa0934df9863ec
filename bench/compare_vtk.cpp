// Times Tessera against vtkResampleToImage, in one process, runs interleaved: everything after reading and
// before writing; of the OpenGL algorithms that includes binding, upload and read-back. compare_vtk mesh.vtu
// [--algorithms software,slicing,hybrid] [--runs 5] [--threads 2] [--points 64,128,256]
// [--csv bench/results/compare_vtk.csv]

#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "arguments.h"
#include "base/timer.h"
#include "bench_statistics.h"
#include "mesh_files/read_mesh.h"
#include "tessera/registry.h"
#include "uniform_run.h"
#include "vtk_resample.h"

namespace {

using tessera::bench::medianOf;

struct Options {
    std::string meshPath, csvPath;
    std::vector<std::string> algorithms{"software"};
    std::vector<int> sizes{64, 128, 256};
    int runs = 5, threads = 2;
};

struct Sample {
    double planMs = 0, resampleMs = 0, verifyMs = 0, totalMs = 0;

    double withoutVerifyMs() const { return totalMs - verifyMs; }
};

Sample runOnce(const tessera::TetMesh& mesh, const std::vector<int>& fields,
               const tessera::Resampler& resampler, int points, int threads) {
    const tessera::Timer timer;
    const tessera::BrickResult result = tessera::bench::runUniform(mesh, fields, resampler, points, threads);
    Sample sample;
    sample.totalMs = timer.elapsedMs();
    sample.planMs = result.times.planMs;
    sample.resampleMs = result.times.resampleMs;
    sample.verifyMs = result.times.verifyMs;
    return sample;
}

/// All runs of one lattice size: VTK's times, and the samples of every algorithm.
struct Series {
    std::vector<double> vtkMs;
    std::vector<std::vector<Sample>> ofAlgorithms;
};

Series runInterleaved(const Options& options, const tessera::TetMesh& mesh, const std::vector<int>& fields,
                      const std::vector<const tessera::Resampler*>& resamplers,
                      const tessera::bench::VtkResample& vtk, int points) {
    for (const tessera::Resampler* resampler : resamplers)
        runOnce(mesh, fields, *resampler, points, options.threads);
    Series series;
    series.ofAlgorithms.resize(resamplers.size());
    for (int r = 0; r < options.runs; ++r) {
        series.vtkMs.push_back(vtk.run(points));
        for (std::size_t a = 0; a < resamplers.size(); ++a)
            series.ofAlgorithms[a].push_back(runOnce(mesh, fields, *resamplers[a], points, options.threads));
    }
    return series;
}

/// Prints one algorithm's row and returns it for the CSV.
std::string report(const Options& options, int points, const std::string& algorithm, double vtkMs,
                   const std::vector<Sample>& samples) {
    const double plan = medianOf(samples, [](const Sample& s) { return s.planMs; });
    const double resample = medianOf(samples, [](const Sample& s) { return s.resampleMs; });
    const double verify = medianOf(samples, [](const Sample& s) { return s.verifyMs; });
    const double total = medianOf(samples, [](const Sample& s) { return s.totalMs; });
    const double bare = medianOf(samples, [](const Sample& s) { return s.withoutVerifyMs(); });
    fmt::print("{:>7}^3 {:<9} {:>9.0f} {:>8.1f} {:>10.1f} {:>8.1f} {:>10.1f} {:>14.1f} {:>8.1f} {:>14.1f}\n",
               points, algorithm, vtkMs, plan, resample, verify, total, bare, vtkMs / total, vtkMs / bare);
    std::fflush(stdout);
    return fmt::format("{},{},{},{},{:.1f},{:.1f},{:.1f},{:.1f},{:.1f},{:.1f},{:.2f},{:.2f}\n", points,
                       algorithm, options.threads, options.runs, vtkMs, plan, resample, verify, total, bare,
                       vtkMs / total, vtkMs / bare);
}

void compare(const Options& options) {
    std::vector<const tessera::Resampler*> resamplers;
    for (const std::string& name : options.algorithms) resamplers.push_back(&tessera::findResampler(name));
    const tessera::bench::VtkResample vtk(options.meshPath, options.threads);
    const tessera::MeshFile file = tessera::readMesh(options.meshPath, {}, {});
    const std::vector<int> fields = tessera::everyField(file.mesh);
    fmt::print(
        "{} elements, {} threads, VTK backend {}, median of {} interleaved runs after one run of every "
        "algorithm that isn't timed (OpenGL compiles its shaders then), milliseconds\n",
        file.mesh.elementCount(), options.threads, vtk.backend(), options.runs);
    fmt::print("{:>9} {:<9} {:>9} {:>8} {:>10} {:>8} {:>10} {:>14} {:>8} {:>14}\n", "points", "algorithm",
               "VTK", "plan", "resample", "verify", "total", "without verify", "ratio", "without verify");
    std::string csv =
        "points,algorithm,threads,runs,vtk_ms,plan_ms,resample_ms,verify_ms,total_ms,without_verify_ms,"
        "ratio,ratio_without_verify\n";
    for (const int points : options.sizes) {
        const Series series = runInterleaved(options, file.mesh, fields, resamplers, vtk, points);
        const double vtkMs = medianOf(series.vtkMs, [](double ms) { return ms; });
        for (std::size_t a = 0; a < resamplers.size(); ++a)
            csv += report(options, points, options.algorithms[a], vtkMs, series.ofAlgorithms[a]);
    }
    tessera::bench::writeText(options.csvPath, csv);
}

}  // namespace

int main(int count, char** words) {
    Options options;
    tessera::bench::Arguments arguments("Times Tessera against vtkResampleToImage.");
    arguments.addNeeded("mesh", options.meshPath, "a .vtu file, e.g. that of make_graded_mesh.py");
    arguments.add("--algorithms", options.algorithms, "software, slicing, hybrid, compute");
    arguments.add("--csv", options.csvPath, "also write the figures here");
    arguments.add("--points", options.sizes, "lattice points along an axis");
    arguments.add("--runs", options.runs, "", {1, 1000});
    arguments.add("--threads", options.threads, "", {1, 1024});
    return arguments.run(count, words, [&] {
        compare(options);
        return 0;
    });
}
