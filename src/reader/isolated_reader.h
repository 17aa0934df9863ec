#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "mesh_files/read_mesh.h"
#include "reader/reader_limits.h"
#include "reader/reader_report.h"

namespace tessera {

/// The programs that read in a process of their own.
struct IsolatedReader {
    /// One that calls serveMeshReader with the arguments it finds behind these.
    std::string executable;
    std::vector<std::string> arguments;
    /// One that is tried before it, as tessera_read_mesh: it reads the common formats alone (readCommonMesh),
    /// and so starts ten times faster. It is given the request alone. Empty: none; one that can't be used is
    /// left out.
    std::string quickExecutable{};
    /// The option that sets a bound on its time, for messages.
    std::string timeOption = "--max-read-time";
};

/// A program that lies beside another, or among the programs that belong to that; empty when there is none.
std::string programBeside(const std::string& executable, const std::string& name);
/// The built or installed tessera_read_mesh that belongs to a tessera program; empty when there is none.
std::string quickReaderBeside(const std::string& executable);

/// Takes an answer's packet. @param mostBytes that it and what is made of it may take.
using TakeAnswer = std::function<void(std::span<const std::byte> packet, std::int64_t mostBytes)>;

/// Has a process of its own do a task, which takes crashes, endless loops and endless demands for memory with
/// it: they become an InputError that begins with `name` and says what happened. Its errors keep their type
/// and words. The answer comes through memory that both share, sealed.
/// @param request parent and memoryBytes are filled in here. @param take is called once with the answer's
/// packet, and throws DamagedPacket where that isn't sound. Throws IoError when the process can't be started,
/// std::bad_alloc when this one's own address space is too small.
void askReader(const IsolatedReader& reader, ReaderRequest request, const std::string& name,
               const IsolationLimits& limits, const Execution& execution, const TakeAnswer& take);

/// askReader for a task whose answer is a mesh (packMesh).
MeshFile askForMesh(const IsolatedReader& reader, ReaderRequest request, const IsolationLimits& limits,
                    const Execution& execution);

/// readMesh by askReader. Errors, warnings and the mesh are those of readMesh, bit for bit.
MeshFile readMeshIsolated(const IsolatedReader& reader, const std::string& path, const ReadOptions& options,
                          const IsolationLimits& limits, const Execution& execution);

}  // namespace tessera
