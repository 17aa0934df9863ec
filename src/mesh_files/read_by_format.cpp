#include "mesh_files/read_by_format.h"

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "files/input_file.h"
#include "files/named_file.h"
#include "mesh_files/assemble_mesh.h"
#include "mesh_files/raw_mesh.h"
#include "mesh_files/read_tetgen.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kHeadBytes = 4096;
constexpr const char* kFormats =
    ".vtu .pvtu .vts .pvts .vtr .pvtr .vti .pvti .vtm .vtk (VTK), .ex2 .e .exo .exii .g (Exodus), .cgns, "
    ".case .encas (EnSight), "
    ".foam (OpenFOAM), .node .ele (TetGen)";

bool isOneOf(const std::string& extension, std::initializer_list<const char*> list) {
    return std::find(list.begin(), list.end(), extension) != list.end();
}

bool looksLikeXml(std::string_view bytes) {
    if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);
    const std::size_t first = bytes.find_first_not_of(" \t\r\n");
    return first != std::string_view::npos && bytes[first] == '<';
}

bool looksLikeNetcdfOrHdf5(std::string_view bytes) {
    return bytes.starts_with("CDF") || bytes.starts_with("\x89HDF\r\n\x1a\n");
}

bool looksLikeCgns(std::string_view bytes) {
    return bytes.starts_with("\x89HDF\r\n\x1a\n") ||
           bytes.substr(0, 64).find("ADF Database") != std::string_view::npos;
}

/// Chooses by content where that tells, else by the name.
RawMesh readRaw(const std::string& path, const ReadOptions& options, const Execution& execution,
                OpenVtkFormat openOther) {
    const std::string extension = extensionOf(path);
    std::error_code error;
    if (extension == ".foam" &&
        std::filesystem::exists(path, error))  // a marker beside the case, mostly empty
        return readVtk(path, VtkFormat::openfoam, options, execution, openOther);
    const std::string head = InputFile(path).copy(0, kHeadBytes);
    if (isOneOf(extension, {".node", ".ele"})) return readTetgen(path, options);
    if (head.starts_with("# vtk DataFile"))
        return readVtk(path, VtkFormat::legacy, options, execution, openOther);
    if (isOneOf(extension,
                {".vtu", ".pvtu", ".vts", ".pvts", ".vtr", ".pvtr", ".vti", ".pvti", ".vtm", ".vtmb"}))
        return readVtk(path, VtkFormat::xml, options, execution, openOther);
    if (extension == ".vtk")
        return readVtk(path, looksLikeXml(head) ? VtkFormat::xml : VtkFormat::legacy, options, execution,
                       openOther);
    if (isOneOf(extension, {".ex2", ".e", ".exo", ".exii", ".g"})) {
        if (!looksLikeNetcdfOrHdf5(head))
            throw InputError(path + ": isn't an Exodus file: expected a NetCDF or HDF5 head");
        return readVtk(path, VtkFormat::exodus, options, execution, openOther);
    }
    if (extension == ".cgns") {
        if (!looksLikeCgns(head))
            throw InputError(path + ": isn't a CGNS file: expected an HDF5 or ADF head");
        return readVtk(path, VtkFormat::cgns, options, execution, openOther);
    }
    if (isOneOf(extension, {".case", ".encas"})) {
        if (head.find("FORMAT") == std::string_view::npos)
            throw InputError(path + ": isn't an EnSight case file: there is no FORMAT section");
        return readVtk(path, VtkFormat::ensight, options, execution, openOther);
    }
    if (looksLikeXml(head) && head.find("<VTKFile") != std::string_view::npos)
        return readVtk(path, VtkFormat::xml, options, execution, openOther);
    if (extension == ".nvdb") throw InputError(path + ": is a NanoVDB file; tessera reads .vdb files");
    throw InputError(path + ": unknown format; known are " + kFormats);
}

/// Adds another file of the same mesh.
void appendPart(RawMesh& mesh, RawMesh part, std::size_t number, const std::string& first,
                const std::string& path) {
    if (part.statistics.format != mesh.statistics.format)
        throw InputError(path + ": is of another kind (" + part.statistics.format + ") than " + first + " (" +
                         mesh.statistics.format + "), and both are parts of one mesh");
    for (RawBlock& block : part.blocks) {
        block.part = number;
        mesh.blocks.push_back(std::move(block));
    }
    mesh.statistics.skippedCells += part.statistics.skippedCells;
    mesh.statistics.blankedCells += part.statistics.blankedCells;
    mesh.statistics.higherOrderCells += part.statistics.higherOrderCells;
    std::vector<std::string>& warnings = mesh.statistics.warnings;
    for (std::string& warning : part.statistics.warnings)  // most are the same for every part
        if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end())
            warnings.push_back(std::move(warning));
}

/// Parallel programs write such parts too.
void warnOfEmptyPart(const RawMesh& part, const std::string& path, ImportStatistics& statistics) {
    if (part.blocks.empty()) statistics.warnings.push_back("Part " + path + " has no 3D cells of its own.");
}

}  // namespace

void checkParts(const std::string& path, const ReadOptions& options) {
    if (options.followsLinks || options.namedBy.empty()) return;
    const std::string folder = folderOf(options.namedBy);
    checkInFolder(folder, options.namedBy, path);
    for (const std::string& part : options.otherParts) checkInFolder(folder, options.namedBy, part);
}

MeshFile readByFormat(const std::string& path, const ReadOptions& options, const Execution& execution,
                      OpenVtkFormat openOther) {
    execution.throwIfCancelled();
    checkParts(path, options);
    RawMesh raw = readRaw(path, options, execution, openOther);
    if (!options.otherParts.empty()) warnOfEmptyPart(raw, path, raw.statistics);
    for (std::size_t p = 0; p < options.otherParts.size(); ++p) {
        execution.throwIfCancelled();
        RawMesh part = readRaw(options.otherParts[p], options, execution, openOther);
        warnOfEmptyPart(part, options.otherParts[p], part.statistics);
        appendPart(raw, std::move(part), p + 1, path, options.otherParts[p]);
    }
    return assembleMesh(path, std::move(raw), options, execution);
}

MeshFile readCommonMesh(const std::string& path, const ReadOptions& options, const Execution& execution) {
    return readByFormat(path, options, execution, nullptr);
}

}  // namespace tessera
