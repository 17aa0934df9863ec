#pragma once

#include <optional>
#include <string>

#include "job/import_mesh.h"
#include "job/run_report.h"
#include "mesh/repair.h"

namespace tessera {

/// How many degenerate elements there are of each class; one line.
std::string classesText(const ClassCounts& counts, const ClassLimits& limits);
Json classesJson(const ClassCounts& counts, const ClassLimits& limits);

/// Says what a repair did, and warns when degenerate elements stay or more than 1e-6 of the volume has
/// changed. Nothing without a repair.
void tellRepair(const std::string& path, const ImportedMesh& mesh, const Job& job);
/// Adds the key `repair` to a document. Nothing without a repair.
void addRepair(Json& document, const ImportedMesh& mesh);

/// What a .vdb file says of the repair its mesh went through; empty without one.
std::string encodeRepair(const std::optional<RepairOptions>& options);
/// Throws InputError when the text is damaged.
std::optional<RepairOptions> decodeRepair(const std::string& text);

}  // namespace tessera
