#pragma once

#include <vtkAlgorithm.h>
#include <vtkSmartPointer.h>

#include <memory>
#include <string>
#include <vector>

#include "io/read_vtk.h"
#include "io/unique_names.h"

namespace tessera {

/// A reader ready to run, and what it reads.
struct VtkSource {
    vtkSmartPointer<vtkAlgorithm> reader;
    std::string format;
    std::string nodeIds{};  ///< the array with the file's number of every point, where blocks share points
    std::vector<std::string> warnings{};       ///< what is odd about the file, a sentence each
    std::shared_ptr<RenamedFields> renamed{};  ///< after reading; null where names are taken as they are
};

}  // namespace tessera
