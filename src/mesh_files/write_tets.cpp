#include "mesh_files/write_tets.h"

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkDoubleArray.h>
#include <vtkErrorCode.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkTypeInt64Array.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include "files/atomic_file.h"
#include "mesh_files/read_mesh.h"
#include "mesh_files/vtk_messages.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// The array borrows the values: VTK only reads them.
void borrow(vtkDoubleArray* array, const double* values, std::size_t count, int components) {
    array->SetNumberOfComponents(components);
    array->SetArray(const_cast<double*>(values), vtkIdType(count), 1);
}

void fillGrid(const TetMesh& mesh, vtkUnstructuredGrid* grid) {
    static_assert(sizeof(Vec3d) == 3 * sizeof(double));
    vtkNew<vtkDoubleArray> coordinates;
    borrow(coordinates, mesh.points.empty() ? nullptr : &mesh.points[0].x, mesh.points.size() * 3, 3);
    vtkNew<vtkPoints> points;
    points->SetDataType(VTK_DOUBLE);
    points->SetData(coordinates);
    grid->SetPoints(points);

    vtkNew<vtkTypeInt64Array> offsets, nodes;
    offsets->SetNumberOfValues(vtkIdType(mesh.elementCount() + 1));
    nodes->SetNumberOfValues(vtkIdType(mesh.elementCount() * 4));
    for (std::int64_t e = 0; e <= mesh.elementCount(); ++e) offsets->SetValue(vtkIdType(e), 4 * e);
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e)
        for (std::size_t i = 0; i < 4; ++i)
            nodes->SetValue(vtkIdType(4 * e + std::int64_t(i)), mesh.tets[std::size_t(e)][i]);
    vtkNew<vtkCellArray> cells;
    cells->SetData(offsets, nodes);
    grid->SetCells(VTK_TETRA, cells);

    for (const Field& field : mesh.fields) {
        vtkNew<vtkDoubleArray> array;
        array->SetName(field.name.c_str());
        borrow(array, field.values.data(), field.values.size(), field.components);
        if (field.location == FieldLocation::point)
            grid->GetPointData()->AddArray(array);
        else
            grid->GetCellData()->AddArray(array);
    }
}

}  // namespace

void writeTets(const TetMesh& mesh, const std::string& path) {
    const VtkMessages messages;
    vtkNew<vtkUnstructuredGrid> grid;
    fillGrid(mesh, grid);
    vtkNew<vtkXMLUnstructuredGridWriter> writer;
    writer->SetInputData(grid);
    writer->SetDataModeToAppended();
    writer->EncodeAppendedDataOff();
    writer->SetCompressorTypeToZLib();
    writer->SetHeaderTypeToUInt64();
    writer->WriteToOutputStringOn();
    if (!writer->Write() || writer->GetErrorCode() != vtkErrorCode::NoError || !messages.errors().empty())
        throw IoError("can't write " + path + ": " +
                      (messages.errors().empty() ? "VTK's writer failed" : messages.errors().front()));
    writeFileAtomically(path, writer->GetOutputString());
}

}  // namespace tessera
