#include "tessera/read.h"

#include <filesystem>

#include "library/program.h"
#include "mesh_files/mesh_series.h"
#include "mesh_files/read_surface.h"
#include "reader/isolated_reader.h"
#include "reader/isolated_tetrahedra.h"
#include "tessera/error.h"

namespace tessera {

namespace {

IsolatedReader findReader(const std::string& given) {
    const std::string program = given.empty() ? findProgram() : given;
    if (program.empty())
        throw IoError(
            "the program tessera, which reads meshes in a separate process, was not found beside the library "
            "nor in PATH: name it in InputOptions::program, or read in this process by isIsolated = false");
    if (!isProgram(program)) throw IoError(program + " is no program that can be run; it is to read meshes");
    return {program, {"read-mesh"}, quickReaderBeside(program)};
}

InputMesh inputOf(MeshFile file, const std::string& path) {
    return {std::move(file.mesh), std::filesystem::path(path).filename().string(), std::nullopt,
            std::move(file.statistics.warnings)};
}

InputMesh readFiles(const std::vector<std::string>& files, const std::string& collection, int step,
                    const InputOptions& options, const Execution& execution) {
    if (files.empty()) throw InputError("a step without a file can't be read");
    const ReadOptions read{
        options.fields, step, {files.begin() + 1, files.end()}, collection, options.followsLinks};
    execution.report(Stage::reading, 0, 1);
    IsolationLimits limits;
    limits.memoryBytes = options.maxMemoryBytes;
    limits.seconds = options.maxSeconds;
    if (limits.memoryBytes < 0 || !(limits.seconds >= 0))
        throw InputError("bounds on the reading of a mesh must not be negative");
    if (isSurfaceName(files[0])) {
        const std::string program = options.program.empty() ? findProgram() : options.program;
        const std::optional<IsolatedReader> found = tetrahedralizerBeside(program);
        MeshFile made = tetrahedralizeIsolated(requireTetrahedralizer(found, files[0]), files[0], read, {},
                                               limits, execution);
        return inputOf(std::move(made), files[0]);
    }
    MeshFile file = options.isIsolated
                        ? readMeshIsolated(findReader(options.program), files[0], read, limits, execution)
                        : readMesh(files[0], read, execution);
    return inputOf(std::move(file), files[0]);
}

}  // namespace

InputMesh read(const InputStep& step, const InputOptions& options, const Execution& execution) {
    InputMesh input = readFiles(step.files, step.collection, options.step, options, execution);
    input.time = step.time;
    // The parts of a mesh have the name of the file that lists them.
    if (step.files.size() > 1) input.sourceFile = std::filesystem::path(step.collection).filename().string();
    return input;
}

InputMesh read(const std::string& path, const InputOptions& options, const Execution& execution) {
    if (!isCollectionName(path)) return readFiles({path}, "", options.step, options, execution);
    const std::vector<InputStep> steps = listSteps({path});
    if (options.step >= int(steps.size()))
        throw InputError(path + ": there is no time step " + std::to_string(options.step) + "; it has " +
                         std::to_string(steps.size()) + ", counted from 0");
    InputOptions ofFile = options;
    ofFile.step = -1;
    return read(options.step < 0 ? steps.back() : steps[std::size_t(options.step)], ofFile, execution);
}

std::vector<InputStep> listSteps(const std::vector<std::string>& inputs) {
    std::vector<InputStep> steps;
    for (SeriesStep& step : listSeries(inputs))
        steps.push_back({std::move(step.files), std::move(step.collection), step.time});
    return steps;
}

}  // namespace tessera
