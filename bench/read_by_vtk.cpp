#include "read_by_vtk.h"

#include <vtkNew.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridReader.h>

#include <chrono>
#include <stdexcept>

namespace tessera::bench {

double readByVtk(const std::string& path) {
    vtkNew<vtkXMLUnstructuredGridReader> reader;
    reader->SetFileName(path.c_str());
    const auto start = std::chrono::steady_clock::now();
    reader->Update();
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - start;
    if (reader->GetOutput()->GetNumberOfCells() == 0) throw std::runtime_error(path + ": VTK read no cells");
    return elapsed.count();
}

}  // namespace tessera::bench
