#pragma once

#include <vtkAlgorithm.h>
#include <vtkSmartPointer.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "mesh_files/read_vtk.h"

namespace tessera {

/// What became of arrays whose name another one has already.
struct RenamedFields {
    std::vector<std::string> names;     ///< as the file has them, each once
    std::vector<std::string> newNames;  ///< "T_2"
};

/// A reader ready to run, and what it reads.
struct VtkSource {
    vtkSmartPointer<vtkAlgorithm> reader;
    std::string format;
    std::string nodeIds{};  ///< the array with the file's number of every point, where blocks share points
    std::vector<std::string> warnings{};           ///< what is odd about the file, a sentence each
    std::shared_ptr<RenamedFields> renamed{};      ///< after reading; null where names are taken as they are
    std::function<void(double time)> checkTime{};  ///< before that time is read; throws InputError
};

}  // namespace tessera
