#pragma once

#include <optional>
#include <string>

#include "commands.h"
#include "mesh/repair.h"
#include "mesh_files/read_mesh.h"
#include "run_report.h"

namespace tessera {

/// A mesh as a command works on it: read, and repaired when that is wanted.
struct ImportedMesh : MeshFile {
    std::optional<RepairReport> repair;
    double repairMs = 0;
};

/// Nothing without --repair. Throws InputError for values out of range.
std::optional<RepairOptions> repairOptions(const RepairArguments& arguments);

/// Throws InputError as readMesh does, and when a repair leaves no element.
ImportedMesh importMesh(const std::string& path, const ReadOptions& read,
                        const std::optional<RepairOptions>& repair, Session& session);

/// How many degenerate elements there are of each class; one line.
std::string classesText(const ClassCounts& counts, const ClassLimits& limits);
Json classesJson(const ClassCounts& counts, const ClassLimits& limits);

/// Prints what a repair did, and warns on standard error when degenerate elements stay or more than 1e-6 of
/// the volume has changed. Nothing without a repair.
void showRepair(const std::string& path, const ImportedMesh& mesh,
                const std::optional<RepairOptions>& options, Session& session);
/// Null without a repair.
Json repairJson(const ImportedMesh& mesh, const std::optional<RepairOptions>& options);

/// What a .vdb file says of the repair its mesh went through; empty without one.
std::string encodeRepair(const std::optional<RepairOptions>& options);
/// Throws InputError when the text is damaged.
std::optional<RepairOptions> decodeRepair(const std::string& text);

}  // namespace tessera
