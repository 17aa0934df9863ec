#include "vtk_resample.h"

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkResampleToImage.h>
#include <vtkSMPTools.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridReader.h>

#include <chrono>
#include <stdexcept>

namespace tessera::bench {

struct VtkResample::Impl {
    vtkNew<vtkXMLUnstructuredGridReader> reader;
};

VtkResample::VtkResample(const std::string& path, int threads) : impl_(new Impl) {
    vtkSMPTools::SetBackend("TBB");
    vtkSMPTools::Initialize(threads);
    impl_->reader->SetFileName(path.c_str());
    impl_->reader->Update();
    if (impl_->reader->GetOutput()->GetNumberOfCells() == 0)
        throw std::runtime_error(path + ": VTK read no cells");
}

VtkResample::~VtkResample() = default;

double VtkResample::run(int points) const {
    // A new data object a run, so that nothing built on the last one (cell links, locators) is left over.
    vtkNew<vtkUnstructuredGrid> grid;
    grid->DeepCopy(impl_->reader->GetOutput());
    vtkNew<vtkResampleToImage> filter;
    filter->SetInputDataObject(grid);
    filter->SetSamplingDimensions(points, points, points);
    const auto start = std::chrono::steady_clock::now();
    filter->Update();
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - start;
    if (filter->GetOutput()->GetNumberOfPoints() != vtkIdType(points) * points * points)
        throw std::runtime_error("vtkResampleToImage gave no samples");
    return elapsed.count();
}

std::string VtkResample::backend() const {
    return vtkSMPTools::GetBackend();
}

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
