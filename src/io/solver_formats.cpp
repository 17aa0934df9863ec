#include "io/solver_formats.h"

#include <vtkCGNSReader.h>
#include <vtkExodusIIReader.h>
#include <vtkGenericEnSightReader.h>
#include <vtkOpenFOAMReader.h>

#include "base/error.h"
#include "io/ensight_check.h"
#include "io/open_check.h"
#include "io/vtk_source.h"

namespace tessera {

namespace {

VtkSource openExodus(const std::string& path) {
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

VtkSource openCgns(const std::string& path) {
    checkCgnsFile(path);
    auto reader = vtkSmartPointer<vtkCGNSReader>::New();
    reader->SetFileName(path.c_str());
    reader->SetDoublePrecisionMesh(1);
    reader->SetLoadBndPatch(false);
    reader->UpdateInformation();
    reader->EnableAllBases();
    reader->EnableAllFamilies();
    reader->EnableAllPointArrays();
    reader->EnableAllCellArrays();
    return {reader, "CGNS"};
}

VtkSource openEnSight(const std::string& path) {
    checkEnSightCase(path);
    auto reader = vtkSmartPointer<vtkGenericEnSightReader>::New();
    reader->SetCaseFileName(path.c_str());
    reader->ReadAllVariablesOn();
    return {reader, "EnSight"};
}

VtkSource openFoam(const std::string& path) {
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
    return {reader, "OpenFOAM"};
}

}  // namespace

VtkSource openSolverFormat(const std::string& path, VtkFormat format) {
    switch (format) {
        case VtkFormat::exodus:
            return openExodus(path);
        case VtkFormat::cgns:
            return openCgns(path);
        case VtkFormat::ensight:
            return openEnSight(path);
        case VtkFormat::openfoam:
            return openFoam(path);
        default:
            TESSERA_CHECK(false, "a format of a solver");
    }
    return {};
}

}  // namespace tessera
