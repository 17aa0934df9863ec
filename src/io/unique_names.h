#pragma once

#include <vtkSmartPointer.h>
#include <vtkXMLDataElement.h>

#include <memory>
#include <string>
#include <vector>

namespace tessera {

/// What became of arrays whose name another one has already.
struct RenamedFields {
    std::vector<std::string> names;     ///< as the file has them, each once
    std::vector<std::string> newNames;  ///< "T_2"
};

/// Gives every array of points, and of cells, a name of its own: the second T becomes T_2 in every piece.
/// @param file the element <VTKFile>.
void makeNamesUnique(vtkXMLDataElement* file, RenamedFields& renamed);

/// A reader of VTK's that meets unique names only. VTK keeps arrays by name but counts those in the file, so
/// of two of one name it loses one, and gives others wrong values or crashes.
template <class Reader>
class UniqueNames : public Reader {
  public:
    static vtkSmartPointer<UniqueNames> create(std::shared_ptr<RenamedFields> renamed) {
        auto reader = vtkSmartPointer<UniqueNames>::Take(new UniqueNames);
        reader->InitializeObjectBase();
        reader->renamed_ = std::move(renamed);
        return reader;
    }

  protected:
    int ReadVTKFile(vtkXMLDataElement* file) override {
        makeNamesUnique(file, *renamed_);
        return Reader::ReadVTKFile(file);
    }

  private:
    std::shared_ptr<RenamedFields> renamed_;
};

}  // namespace tessera
