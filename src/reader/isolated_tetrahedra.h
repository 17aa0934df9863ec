#pragma once

#include <optional>
#include <string>

#include "reader/isolated_reader.h"
#include "surface/tetrahedralize_options.h"

namespace tessera {

/// The task of a process that makes tetrahedra of a surface or points, and the hidden subcommand of the
/// program that has it. No other program links TetGen.
inline constexpr const char* kTetrahedralizeTask = "tetrahedralize";
inline constexpr const char* kMakeTetrahedraCommand = "make-tetrahedra";
inline constexpr const char* kTetrahedralizer = "tessera-tetrahedralize";

/// That program, where it is installed beside another.
std::optional<IsolatedReader> tetrahedralizerBeside(const std::string& executable);

/// What was found, or an InputError that says what the file holds and what it needs.
const IsolatedReader& requireTetrahedralizer(const std::optional<IsolatedReader>& found,
                                             const std::string& path);

/// Has it read a surface or points (isSurfaceName) and make tetrahedra. Limits that aren't given are three
/// quarters of the memory here, and times by the file's size and what is asked for. Throws as
/// readMeshIsolated, and InputError for surfaces that bound no volume.
MeshFile tetrahedralizeIsolated(const IsolatedReader& program, const std::string& path,
                                const ReadOptions& read, const TetrahedralizeOptions& options,
                                const IsolationLimits& limits, const Execution& execution);

/// As they go in ReaderRequest::body.
std::string packOptions(const TetrahedralizeOptions& options);
/// Throws InputError for what packOptions didn't make.
TetrahedralizeOptions unpackOptions(const std::string& body);

}  // namespace tessera
