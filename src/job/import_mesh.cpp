#include "job/import_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "base/timer.h"
#include "job/series_steps.h"
#include "job/tetrahedralize_file.h"
#include "mesh_files/read_surface.h"
#include "reader/isolated_tetrahedra.h"
#include "refine/plan_frame.h"
#include "tessera/error.h"

namespace tessera {

namespace {
constexpr double kReadBytesPerMs = 20e3, kReadStartMs = 150;  // with checks and handing over
}

MeshFile openMesh(const std::string& path, const ReadOptions& given, Job& job) {
    ReadOptions options = given;
    options.followsLinks |= job.followsLinks;
    if (isCollectionName(path)) {
        const SeriesStep step = chosenStep(path, options.timeStep);
        return openMesh(step.files[0], readOptions(step, options.fields, -1), job);
    }
    if (isSurfaceName(path)) {
        requireTetrahedralizer(job.tetrahedralizer, path);
        job.say(fmt::format("{}: holds no cells; {} makes tetrahedra of it\n", path, kTetrahedralizer));
        return makeTetrahedra(path, options, {}, job);
    }
    std::error_code error;
    const auto bytes = std::filesystem::file_size(path, error);
    job.execution.expect(Stage::reading, kReadStartMs + (error ? 0 : double(bytes)) / kReadBytesPerMs);
    job.execution.report(Stage::reading, 0, 1);
    if (!job.reader) return readMesh(path, options, job.execution);
    MeshFile file = readMeshIsolated(*job.reader, path, options, job.readerLimits, job.execution);
    job.readPeakBytes = std::max(job.readPeakBytes, file.readPeakBytes);
    return file;
}

ImportedMesh importMesh(const std::string& path, const ReadOptions& read,
                        const std::optional<RepairOptions>& options, Job& job) {
    ImportedMesh file{openMesh(path, read, job), options, {}, 0, {}};
    if (options) {
        Timer timer;
        file.mesh = repair(std::move(file.mesh), *options, file.repair, job.execution);
        file.repairMs = timer.elapsedMs();
        if (file.mesh.tets.empty())
            throw InputError(fmt::format(
                "{}: --repair leaves nothing of {} elements, all of an aspect ratio below {:g}: a smaller "
                "--repair-aspect or --repair-max-volume-loss keeps those whose volume isn't zero",
                path, file.repair.elementsBefore, options->limits.minAspect));
    }
    file.boundsWorld = meshBounds(file.mesh, job.execution.withoutProgress(), nullptr);
    return file;
}

}  // namespace tessera
