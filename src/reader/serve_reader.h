#pragma once

#include <functional>
#include <span>
#include <string>

#include "mesh_files/read_mesh.h"
#include "reader/packet.h"
#include "reader/reader_limits.h"
#include "reader/reader_report.h"

namespace tessera {

/// Something that a reading process can be asked for.
struct ReaderTask {
    std::string name;
    /// Usual limits, from a look at the file.
    std::function<IsolationLimits(const ReaderRequest& request)> limits;
    /// The answer. @param limits those that hold.
    std::function<Packet(const ReaderRequest& request, const IsolationLimits& limits,
                         const Execution& execution)>
        run;
};

/// Tells the process that asked what this one is at. Only within ReaderTask::run.
void reportStage(Stage stage);

using MeshReader =
    std::function<MeshFile(const std::string& path, const ReadOptions& options, const Execution& execution)>;

/// The task "mesh" of readMeshIsolated.
ReaderTask meshTask(MeshReader read = readMesh);

/// The other side of askReader, to be called before anything else in the program that it starts: bounds this
/// process, does what it is asked for and reports. Returns the exit code; leave with it by _exit, as
/// libraries have nothing to tidy up. Throws InputError when it wasn't started by askReader.
/// @param arguments those behind IsolatedReader::arguments.
int serveReader(std::span<const std::string> arguments, std::span<const ReaderTask> tasks);

}  // namespace tessera
