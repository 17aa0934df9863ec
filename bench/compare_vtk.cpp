// Times Tessera against vtkResampleToImage, in one process, runs interleaved: everything after reading and
// before writing. compare_vtk mesh.vtu [--runs 5] [--threads 2] [--points 64,128,256] [--csv
// bench/results/compare_vtk.csv]

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <fstream>
#include <numeric>
#include <string>
#include <vector>

#include "base/timer.h"
#include "brick/refine.h"
#include "io/read_mesh.h"
#include "registry/registry.h"
#include "vtk_resample.h"

namespace {

struct Sample {
    double vtkMs = 0, planMs = 0, resampleMs = 0, verifyMs = 0, totalMs = 0;
};

double median(const std::vector<Sample>& samples, double Sample::*figure) {
    std::vector<double> values;
    for (const Sample& s : samples) values.push_back(s.*figure);
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size();
    return n % 2 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

Sample runOnce(const tessera::TetMesh& mesh, const std::vector<int>& fields,
               const tessera::bench::VtkResample& vtk, int points, int threads) {
    Sample sample;
    sample.vtkMs = vtk.run(points);
    tessera::RefineOptions options;
    options.criterion = tessera::Criterion::uniform;
    options.resolution = points;
    tessera::Execution execution;
    execution.threads = threads;
    tessera::Timer timer;
    const tessera::BrickResult result =
        tessera::refineAndResample(mesh, fields, tessera::findResampler("software"), options, execution);
    sample.totalMs = timer.elapsedMs();
    sample.planMs = result.times.planMs;
    sample.resampleMs = result.times.resampleMs;
    sample.verifyMs = result.times.verifyMs;
    return sample;
}

int compare(const std::string& path, const std::string& csvPath, const std::vector<int>& sizes, int runs,
            int threads) {
    const tessera::bench::VtkResample vtk(path, threads);
    const tessera::MeshFile file = tessera::readMesh(path, {}, {});
    std::vector<int> fields(file.mesh.fields.size());
    std::iota(fields.begin(), fields.end(), 0);
    fmt::print("{} elements, {} threads, VTK backend {}, median of {} interleaved runs, milliseconds\n",
               file.mesh.elementCount(), threads, vtk.backend(), runs);
    fmt::print("{:>8} {:>10} {:>8} {:>10} {:>8} {:>10} {:>14} {:>8} {:>14}\n", "points", "VTK", "plan",
               "resample", "verify", "total", "without verify", "ratio", "without verify");
    std::string csv =
        "points,threads,runs,vtk_ms,plan_ms,resample_ms,verify_ms,total_ms,ratio,ratio_without_verify\n";
    for (const int points : sizes) {
        std::vector<Sample> samples;
        for (int r = 0; r < runs; ++r) samples.push_back(runOnce(file.mesh, fields, vtk, points, threads));
        const double vtkMs = median(samples, &Sample::vtkMs), totalMs = median(samples, &Sample::totalMs);
        const double plan = median(samples, &Sample::planMs), resample = median(samples, &Sample::resampleMs);
        const double verify = median(samples, &Sample::verifyMs);
        std::vector<Sample> bare = samples;
        for (Sample& s : bare) s.totalMs -= s.verifyMs;
        const double bareMs = median(bare, &Sample::totalMs);
        fmt::print("{:>7}^3 {:>9.0f} {:>8.1f} {:>10.1f} {:>8.1f} {:>10.1f} {:>14.1f} {:>8.1f} {:>14.1f}\n",
                   points, vtkMs, plan, resample, verify, totalMs, bareMs, vtkMs / totalMs, vtkMs / bareMs);
        std::fflush(stdout);
        csv += fmt::format("{},{},{},{:.1f},{:.1f},{:.1f},{:.1f},{:.1f},{:.2f},{:.2f}\n", points, threads,
                           runs, vtkMs, plan, resample, verify, totalMs, vtkMs / totalMs, vtkMs / bareMs);
    }
    if (!csvPath.empty() && !(std::ofstream(csvPath) << csv))
        throw std::runtime_error(csvPath + ": can't be written");
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Times Tessera against vtkResampleToImage.");
    std::string path, csvPath;
    std::vector<int> sizes{64, 128, 256};
    int runs = 5, threads = 2;
    app.add_option("mesh", path, "a .vtu file, e.g. that of make_graded_mesh.py")->required();
    app.add_option("--csv", csvPath, "also write the figures here");
    app.add_option("--points", sizes, "lattice points along an axis")->delimiter(',');
    app.add_option("--runs", runs)->check(CLI::Range(1, 1000));
    app.add_option("--threads", threads)->check(CLI::Range(1, 1024));
    CLI11_PARSE(app, argc, argv);
    try {
        return compare(path, csvPath, sizes, runs, threads);
    } catch (const std::exception& error) {
        fmt::print(stderr, "compare_vtk: {}\n", error.what());
        return 1;
    }
}
