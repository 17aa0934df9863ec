// Times reading a mesh in this process against reading it in a process of its own, runs interleaved: in this
// program, and in fresh runs of `tessera info`. Then VTK's reader of .vtu files against ours, both without
// what follows: its grid against points, elements and fields as a mesh has them. isolated_read mesh.vtu
// [--runs 9] [--threads 0] [--program build/release/apps/tessera/tessera]
// [--csv bench/results/isolated_read.csv]

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "arguments.h"
#include "base/timer.h"
#include "bench_statistics.h"
#include "mesh_files/read_vtu.h"
#include "read_by_vtk.h"
#include "reader/isolated_reader.h"

namespace {

using tessera::bench::medianOf;

struct Options {
    std::string meshPath, csvPath, program = TESSERA_PROGRAM, reader = TESSERA_READER;
    int runs = 9, threads = 0;
};

/// Of this process and of the children that it has reaped.
double processorMsOfAll() {
    rusage usage{};
    getrusage(RUSAGE_CHILDREN, &usage);
    const auto ms = [](const timeval& t) { return double(t.tv_sec) * 1e3 + double(t.tv_usec) * 1e-3; };
    return tessera::bench::processorMs() + ms(usage.ru_utime) + ms(usage.ru_stime);
}

struct Sample {
    double wallMs = 0, processorMs = 0;
};

template <class Read>
Sample timeHere(const Read& read) {
    const double before = processorMsOfAll();
    const tessera::Timer timer;
    const tessera::MeshFile file = read();
    const double wallMs = timer.elapsedMs();
    return {wallMs, processorMsOfAll() - before};
}

/// The reading stage of one run of the command line; its processor time is that of the whole run.
Sample timeProgram(const Options& options, const std::string& reader) {
    const std::string command = fmt::format("'{}' info '{}' --quiet --json - --threads {} --reader {}",
                                            options.program, options.meshPath, options.threads, reader);
    const double before = processorMsOfAll();
    std::string text;
    {
        const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(popen(command.c_str(), "r"), pclose);
        if (!pipe) throw std::runtime_error("can't run " + command);
        for (int c; (c = std::fgetc(pipe.get())) != EOF;) text += char(c);
    }
    return {nlohmann::json::parse(text).at("stages").at("read").get<double>(), processorMsOfAll() - before};
}

struct Pair {
    std::string name;
    std::vector<Sample> inProcess, isolated;
};

/// Prints one row and returns it for the CSV.
std::string row(const Options& options, const std::string& name, const char* figure, double inProcess,
                double isolated) {
    fmt::print("{:<13} {:<15} {:>12.1f} {:>12.1f} {:>8.1f} %\n", name, figure, inProcess, isolated,
               100 * (isolated / inProcess - 1));
    return fmt::format("{},{},{},{},{:.1f},{:.1f}\n", name, figure, options.runs, options.threads, inProcess,
                       isolated);
}

std::string report(const Options& options, const Pair& pair) {
    const auto wall = [](const Sample& s) { return s.wallMs; };
    const auto processor = [](const Sample& s) { return s.processorMs; };
    const auto shortest = [](const std::vector<Sample>& samples) {
        return std::min_element(samples.begin(), samples.end(),
                                [](const Sample& a, const Sample& b) { return a.wallMs < b.wallMs; })
            ->wallMs;
    };
    std::string rows =
        row(options, pair.name, "median wall", medianOf(pair.inProcess, wall), medianOf(pair.isolated, wall));
    rows += row(options, pair.name, "shortest wall", shortest(pair.inProcess), shortest(pair.isolated));
    return rows + row(options, pair.name, "median busy", medianOf(pair.inProcess, processor),
                      medianOf(pair.isolated, processor));
}

void compareReaders(const Options& options, const tessera::Execution& execution) {
    std::vector<double> vtk, ours;
    for (int r = 0; r < options.runs; ++r) {
        vtk.push_back(tessera::bench::readByVtk(options.meshPath));
        const tessera::Timer timer;
        if (!tessera::readPlainVtu(options.meshPath, {}, execution)) return;  // of another form
        ours.push_back(timer.elapsedMs());
    }
    const auto itself = [](double ms) { return ms; };
    const double vtkMs = medianOf(vtk, itself), oursMs = medianOf(ours, itself);
    fmt::print(
        "the reader of .vtu files alone: VTK {:.1f} ms (one thread), ours {:.1f} ms, {:.1f} times as fast\n",
        vtkMs, oursMs, vtkMs / oursMs);
}

void compare(const Options& options) {
    tessera::Execution execution;
    execution.threads = options.threads;
    const tessera::IsolatedReader reader{options.program, {"read-mesh"}, options.reader};
    Pair library{"library", {}, {}}, program{"command line", {}, {}};
    for (int r = -1; r < options.runs; ++r) {  // the first round warms the file cache
        const Sample samples[] = {
            timeHere([&] { return tessera::readMesh(options.meshPath, {}, execution); }),
            timeHere([&] { return tessera::readMeshIsolated(reader, options.meshPath, {}, {}, execution); }),
            timeProgram(options, "in-process"), timeProgram(options, "isolated")};
        if (r < 0) continue;
        library.inProcess.push_back(samples[0]);
        library.isolated.push_back(samples[1]);
        program.inProcess.push_back(samples[2]);
        program.isolated.push_back(samples[3]);
    }
    fmt::print("{}, {} interleaved runs, {} threads, milliseconds\n{:<13} {:<15} {:>12} {:>12} {:>10}\n",
               options.meshPath, options.runs, execution.threadCount(), "", "", "in process", "isolated",
               "more");
    std::string rows = report(options, library);
    rows += report(options, program);
    compareReaders(options, execution);
    tessera::bench::writeText(options.csvPath,
                              "start,figure,runs,threads,in_process_ms,isolated_ms\n" + rows);
}

}  // namespace

int main(int count, char** words) {
    Options options;
    tessera::bench::Arguments arguments(
        "Times reading a mesh in process against reading it in a process of its own.");
    arguments.addNeeded("mesh", options.meshPath,
                        "a .vtu file, e.g. what tessera-tetrahedralize makes of graded:150K");
    arguments.add("--program", options.program, "the tessera program");
    arguments.add("--reader", options.reader,
                  "the program that the library starts; empty: the tessera program");
    arguments.add("--csv", options.csvPath, "also write the figures here");
    arguments.add("--runs", options.runs, "", {1, 1000});
    arguments.add("--threads", options.threads, "", {0, 1024});
    return arguments.run(count, words, [&] {
        compare(options);
        return 0;
    });
}
