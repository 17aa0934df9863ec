#include "mesh_files/solver_formats.h"

#include <vtkCGNSReader.h>
#include <vtkExodusIIReader.h>
#include <vtkGenericEnSightReader.h>
#include <vtkOpenFOAMReader.h>

#include <utility>

#include "base/check.h"
#include "mesh_files/ensight_check.h"
#include "mesh_files/foam_check.h"
#include "mesh_files/foam_files.h"
#include "mesh_files/open_check.h"
#include "mesh_files/vtk_source.h"

namespace tessera {

namespace {

VtkSource openExodus(const std::string& path, const ReadOptions& options) {
    if (!options.followsLinks) refuseLinks(path);
    checkExodusFile(path);
    auto reader = vtkSmartPointer<vtkExodusIIReader>::New();
    reader->SetFileName(path.c_str());
    // Coordinates as they are in the file, and no bookkeeping arrays.
    reader->ApplyDisplacementsOff();
    reader->GenerateObjectIdCellArrayOff();
    reader->GenerateGlobalElementIdArrayOff();
    reader->GenerateGlobalNodeIdArrayOff();
    reader->GenerateImplicitNodeIdArrayOn();  // element blocks share nodes
    reader->UpdateInformation();
    reader->SetAllArrayStatus(vtkExodusIIReader::NODAL, 1);
    reader->SetAllArrayStatus(vtkExodusIIReader::ELEM_BLOCK, 1);
    return {reader, "Exodus II", vtkExodusIIReader::GetImplicitNodeIdArrayName()};
}

VtkSource openCgns(const std::string& path, const ReadOptions& options) {
    if (!options.followsLinks) refuseLinks(path);
    const CgnsFields fields = checkCgnsFile(path);
    auto reader = vtkSmartPointer<vtkCGNSReader>::New();
    reader->SetFileName(path.c_str());
    reader->SetDoublePrecisionMesh(1);
    reader->SetLoadBndPatch(false);
    reader->UpdateInformation();
    reader->EnableAllBases();
    reader->EnableAllFamilies();
    reader->EnableAllPointArrays();
    reader->EnableAllCellArrays();
    // The reader may know a component, or its vector.
    const auto forBoth = [](const std::string& name, const auto& enable) {
        enable(name);
        if (name.ends_with('X') || name.ends_with('Y') || name.ends_with('Z'))
            enable(name.substr(0, name.size() - 1));
    };
    for (const std::string& name : fields.atPoints)
        forBoth(name, [&](const std::string& n) { reader->SetPointArrayStatus(n.c_str(), 1); });
    for (const std::string& name : fields.atCells)
        forBoth(name, [&](const std::string& n) { reader->SetCellArrayStatus(n.c_str(), 1); });
    return {reader, "CGNS", {}, fields.warnings};
}

VtkSource openEnSight(const std::string& path, const ReadOptions& options) {
    std::vector<std::string> warnings = findCutOffFiles(checkEnSightCase(path, allowedFolder(path, options)));
    auto reader = vtkSmartPointer<vtkGenericEnSightReader>::New();
    reader->SetCaseFileName(path.c_str());
    reader->ReadAllVariablesOn();
    return {reader, "EnSight", {}, std::move(warnings)};
}

VtkSource openFoam(const std::string& path, const ReadOptions& options) {
    const std::optional<std::string> folder = allowedFolder(path, options);
    checkFoamFiles(path, folder);
    std::vector<std::string> warnings = checkFoamCase(path);
    auto reader = vtkSmartPointer<vtkOpenFOAMReader>::New();
    reader->SetFileName(path.c_str());
    reader->DecomposePolyhedraOff();
    reader->CreateCellToPointOff();
    reader->UpdateInformation();
    reader->EnableAllCellArrays();
    reader->EnableAllPointArrays();
    reader->DisableAllLagrangianArrays();
    reader->DisableAllPatchArrays();
    reader->SetPatchArrayStatus("internalMesh", 1);
    for (int i = 0; i < reader->GetNumberOfPatchArrays(); ++i) {  // of regions: "/fluid/internalMesh"
        const std::string name = reader->GetPatchArrayName(i);
        if (name.ends_with("/internalMesh")) reader->SetPatchArrayStatus(name.c_str(), 1);
    }
    VtkSource source{reader, "OpenFOAM", {}, std::move(warnings)};
    if (folder) source.checkTime = [path, folder](double time) { checkFoamTime(path, *folder, time); };
    return source;
}

}  // namespace

VtkSource openSolverFormat(const std::string& path, VtkFormat format, const ReadOptions& options) {
    switch (format) {
        case VtkFormat::exodus:
            return openExodus(path, options);
        case VtkFormat::cgns:
            return openCgns(path, options);
        case VtkFormat::ensight:
            return openEnSight(path, options);
        case VtkFormat::openfoam:
            return openFoam(path, options);
        default:
            TESSERA_CHECK(false, "a format of a solver");
    }
    return {};
}

}  // namespace tessera
