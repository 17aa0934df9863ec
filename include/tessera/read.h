#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// How to read a mesh.
struct InputOptions {
    /// Names of the fields to read; "point:T" and "cell:T" tell two of one name apart. Empty: all.
    std::vector<std::string> fields{};
    /// Of files with several steps, and of .pvd files: which one, counted from 0; -1: the last.
    int step = -1;
    /// Meshes are read in a separate process, so that a damaged file costs an error and no crash. False: in
    /// this one.
    bool isIsolated = true;
    /// The installed program `tessera`, which is that process. Empty: the one beside the library that this
    /// program was linked with by Tessera's CMake package, or else the one in PATH.
    std::string program{};
    /// Bounds on that process, bytes and seconds; 0: by the size of the file.
    std::int64_t maxMemoryBytes = 0;
    double maxSeconds = 0;
    /// Files may name others outside their folder: pieces, steps, links.
    bool followsLinks = false;
};

/// A mesh and where it is from.
struct InputMesh {
    TetMesh mesh;
    /// The file's name without its folder.
    std::string sourceFile;
    /// Of a step that a .pvd file gives a time, in the series' own unit.
    std::optional<double> time;
    /// What was odd about the file, a sentence each.
    std::vector<std::string> warnings;
};

/// One step of a time series.
struct InputStep {
    /// Its mesh, or the parts that its mesh is stored in.
    std::vector<std::string> files;
    /// The .pvd file that lists it; empty for others.
    std::string collection;
    std::optional<double> time;
};

/// Reads a mesh file of any format in the README, or a step of a .pvd file. Cells are split into tetrahedra
/// so that both sides of a shared face are cut alike; of surfaces and points the program
/// tessera-tetrahedralize makes tetrahedra, where it is installed. Throws InputError, naming the file and the
/// place, when it is missing, damaged, of unknown format, without 3D cells or without such a field; IoError
/// when the separate process can't be started; Cancelled.
InputMesh read(const std::string& path, const InputOptions& options = {}, const Execution& execution = {});
/// The same for a step of a series; `options.step` is of files that have several steps themselves.
InputMesh read(const InputStep& step, const InputOptions& options = {}, const Execution& execution = {});

/// The steps of a series in their order: from mesh files, patterns with * or ?, or one .pvd file. Throws
/// InputError when nothing matches, a mesh is named twice or the .pvd file is damaged.
std::vector<InputStep> listSteps(const std::vector<std::string>& inputs);

/// Where InputOptions::program is when it is empty, which also tries drivers of OpenGL before this process
/// uses them. Tessera's CMake package calls it, by the lines below.
void useProgram(const char* path);

}  // namespace tessera

#ifdef TESSERA_PROGRAM
namespace {
[[maybe_unused]] const bool tesseraProgramIsKnown = (tessera::useProgram(TESSERA_PROGRAM), true);
}  // namespace
#endif
