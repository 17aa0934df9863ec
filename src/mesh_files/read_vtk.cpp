#include "mesh_files/read_vtk.h"

#include <vtkAlgorithm.h>
#include <vtkDataArraySelection.h>
#include <vtkDataObject.h>
#include <vtkDataSetReader.h>
#include <vtkInformation.h>
#include <vtkNew.h>
#include <vtkSmartPointer.h>
#include <vtkStreamingDemandDrivenPipeline.h>
#include <vtkXMLDataElement.h>
#include <vtkXMLImageDataReader.h>
#include <vtkXMLMultiBlockDataReader.h>
#include <vtkXMLPImageDataReader.h>
#include <vtkXMLPRectilinearGridReader.h>
#include <vtkXMLPStructuredGridReader.h>
#include <vtkXMLPUnstructuredGridReader.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLRectilinearGridReader.h>
#include <vtkXMLStructuredGridReader.h>
#include <vtkXMLUnstructuredGridReader.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <set>
#include <string_view>

#include "files/name_list.h"
#include "mesh_files/legacy_check.h"
#include "mesh_files/read_vtu.h"
#include "mesh_files/vtk_convert.h"
#include "mesh_files/vtk_messages.h"
#include "mesh_files/vtk_source.h"
#include "mesh_files/xml_check.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Visits the arrays of one <PointData> or <CellData>.
void renameArrays(vtkXMLDataElement* attributes, RenamedFields& renamed) {
    std::set<std::string> taken;
    const int count = attributes->GetNumberOfNestedElements();
    for (int i = 0; i < count; ++i)
        if (const char* name = attributes->GetNestedElement(i)->GetAttribute("Name")) taken.insert(name);
    std::set<std::string> seen;
    for (int i = 0; i < count; ++i) {
        vtkXMLDataElement* array = attributes->GetNestedElement(i);
        const char* given = array->GetAttribute("Name");
        if (!given || seen.insert(given).second) continue;
        const std::string name = given;
        std::string unique;
        for (int number = 2; unique.empty() || !taken.insert(unique).second; ++number)
            unique = name + "_" + std::to_string(number);
        array->SetAttribute("Name", unique.c_str());
        seen.insert(unique);
        if (std::find(renamed.newNames.begin(), renamed.newNames.end(), unique) != renamed.newNames.end())
            continue;  // in another piece, or of the points too
        renamed.newNames.push_back(unique);
        if (std::find(renamed.names.begin(), renamed.names.end(), name) == renamed.names.end())
            renamed.names.push_back(name);
    }
}

/// Gives every array of points, and of cells, a name of its own: the second T becomes T_2 in every piece.
void makeNamesUnique(vtkXMLDataElement* element, RenamedFields& renamed) {
    const std::string_view name = element->GetName() ? element->GetName() : "";
    if (name == "PointData" || name == "CellData") return renameArrays(element, renamed);
    for (int i = 0; i < element->GetNumberOfNestedElements(); ++i)
        makeNamesUnique(element->GetNestedElement(i), renamed);
}

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

struct XmlReaderKind {
    const char* type;         // attribute of <VTKFile>
    const char* description;  // for the user
    vtkSmartPointer<vtkXMLReader> (*make)(const std::shared_ptr<RenamedFields>& renamed);
};

template <class Reader>
vtkSmartPointer<vtkXMLReader> makeXmlReader(const std::shared_ptr<RenamedFields>& renamed) {
    return UniqueNames<Reader>::create(renamed);
}

const XmlReaderKind kXmlReaders[] = {
    {"UnstructuredGrid", "VTK XML unstructured grid", makeXmlReader<vtkXMLUnstructuredGridReader>},
    {"PUnstructuredGrid", "VTK XML parallel unstructured grid", makeXmlReader<vtkXMLPUnstructuredGridReader>},
    {"StructuredGrid", "VTK XML structured grid", makeXmlReader<vtkXMLStructuredGridReader>},
    {"PStructuredGrid", "VTK XML parallel structured grid", makeXmlReader<vtkXMLPStructuredGridReader>},
    {"RectilinearGrid", "VTK XML rectilinear grid", makeXmlReader<vtkXMLRectilinearGridReader>},
    {"PRectilinearGrid", "VTK XML parallel rectilinear grid", makeXmlReader<vtkXMLPRectilinearGridReader>},
    {"ImageData", "VTK XML image data", makeXmlReader<vtkXMLImageDataReader>},
    {"PImageData", "VTK XML parallel image data", makeXmlReader<vtkXMLPImageDataReader>},
    {"PolyData", "VTK XML polygons", makeXmlReader<vtkXMLPolyDataReader>},
    {"vtkMultiBlockDataSet", "VTK XML multi-block", makeXmlReader<vtkXMLMultiBlockDataReader>},
};

/// Leaves out arrays that nobody asked for. Their names stay known, for messages.
void selectArrays(vtkDataArraySelection* selection, FieldLocation location, const ReadOptions& options,
                  std::vector<ArrayInfo>& unread) {
    if (!selection || options.fields.empty()) return;
    for (int a = 0; a < selection->GetNumberOfArrays(); ++a) {
        const std::string name = selection->GetArrayName(a) ? selection->GetArrayName(a) : "";
        if (name.empty() || name.starts_with("vtk") || isWanted(options, name, location)) continue;
        selection->DisableArray(name.c_str());
        unread.push_back({name, location, 1, true});
    }
}

VtkSource openXml(const std::string& path, const DeclaredSize& info) {
    for (const XmlReaderKind& kind : kXmlReaders) {
        if (info.type != kind.type) continue;
        const auto renamed = std::make_shared<RenamedFields>();
        auto reader = kind.make(renamed);
        reader->SetFileName(path.c_str());
        return {reader, kind.description, {}, {}, renamed};
    }
    throw InputError(
        path + ": VTK XML files of type '" + info.type + "' hold no mesh that can be read here" +
        (info.type == "Collection" ? "; name one of its files, or resample the .pvd as a series" : ""));
}

VtkSource openLegacy(const std::string& path) {
    auto reader = vtkSmartPointer<vtkDataSetReader>::New();
    reader->SetFileName(path.c_str());
    reader->ReadAllScalarsOn();
    reader->ReadAllVectorsOn();
    reader->ReadAllNormalsOn();
    reader->ReadAllTensorsOn();
    reader->ReadAllColorScalarsOn();
    reader->ReadAllTCoordsOn();
    reader->ReadAllFieldsOn();
    return {reader, "VTK legacy"};
}

/// Runs the reader for the time step that the options choose.
void update(const std::string& path, const VtkSource& source, const ReadOptions& options) {
    vtkAlgorithm* reader = source.reader;
    reader->UpdateInformation();
    vtkInformation* information = reader->GetOutputInformation(0);
    const int steps = information && information->Has(vtkStreamingDemandDrivenPipeline::TIME_STEPS())
                          ? information->Length(vtkStreamingDemandDrivenPipeline::TIME_STEPS())
                          : 0;
    if (options.timeStep >= std::max(steps, 1))
        throw InputError(path + ": there is no time step " + std::to_string(options.timeStep) + "; it has " +
                         std::to_string(std::max(steps, 1)) + ", counted from 0");
    if (steps == 0) {
        reader->Update();
        return;
    }
    const double* times = information->Get(vtkStreamingDemandDrivenPipeline::TIME_STEPS());
    const double time = times[options.timeStep < 0 ? steps - 1 : options.timeStep];
    if (source.checkTime) source.checkTime(time);
    reader->UpdateTimeStep(time);
}

void throwOnErrors(const std::string& path, const VtkMessages& messages) {
    std::vector<std::string> errors = messages.errors();
    // The legacy reader only warns when an array ends early.
    for (const std::string& warning : messages.warnings())
        if (warning.find("Error reading") != std::string::npos) errors.push_back(warning);
    if (!errors.empty()) throw InputError(path + ": damaged or not readable: " + errors.front());
}

/// A reader may say the same for every cell.
void addVtkWarnings(const std::vector<std::string>& all, ImportStatistics& statistics) {
    std::map<std::string, int> counts;
    for (const std::string& warning : all) ++counts[warning];
    for (const auto& [warning, count] : counts)
        statistics.warnings.push_back("VTK: " + warning +
                                      (count > 1 ? " (" + std::to_string(count) + " times)" : ""));
}

/// Nothing of what a file holds changes its name without a word.
void warnOfRenamed(const RenamedFields& renamed, ImportStatistics& statistics) {
    if (renamed.names.empty()) return;
    statistics.warnings.push_back((renamed.names.size() == 1 ? "More than one field is" : "Fields are") +
                                  std::string(" called ") + nameList(renamed.names) +
                                  "; those behind the first are called " + nameList(renamed.newNames) +
                                  " here.");
}

void checkCounts(const std::string& path, const DeclaredSize& info, vtkDataObject* data) {
    if (info.type != "UnstructuredGrid") return;
    const auto points = std::int64_t(data->GetNumberOfElements(vtkDataObject::POINT));
    const auto cells = std::int64_t(data->GetNumberOfElements(vtkDataObject::CELL));
    if (points != info.points || cells != info.cells)
        throw InputError(path + ": damaged or cut off: it declares " + std::to_string(info.points) +
                         " points and " + std::to_string(info.cells) + " cells, " + std::to_string(points) +
                         " and " + std::to_string(cells) + " could be read");
}

using OpenSource = std::function<VtkSource()>;
using TakeVtkData = std::function<void(vtkDataObject* data, const VtkSource& source)>;

/// Runs the reader of a file that declares such a size. @param unread gets arrays that nobody asked for.
void read(const std::string& path, const DeclaredSize& info, const OpenSource& open,
          const ReadOptions& options, const TakeVtkData& take, ImportStatistics& statistics,
          std::vector<ArrayInfo>& unread) {
    const VtkMessages messages;
    VtkSource opened = open();
    if (auto* xml = vtkXMLReader::SafeDownCast(opened.reader)) {
        xml->UpdateInformation();
        selectArrays(xml->GetPointDataArraySelection(), FieldLocation::point, options, unread);
        selectArrays(xml->GetCellDataArraySelection(), FieldLocation::cell, options, unread);
    }
    throwOnErrors(path, messages);
    update(path, opened, options);
    throwOnErrors(path, messages);
    vtkDataObject* data = opened.reader->GetOutputDataObject(0);
    if (!data) throw InputError(path + ": could not be read as " + opened.format);
    checkCounts(path, info, data);
    statistics.format = opened.format;
    statistics.warnings = opened.warnings;
    if (opened.renamed) warnOfRenamed(*opened.renamed, statistics);
    take(data, opened);
    throwOnErrors(path, messages);
    addVtkWarnings(messages.warnings(), statistics);
}

RawMesh readCells(const std::string& path, VtkFormat format, const ReadOptions& options,
                  const Execution& execution, OpenVtkFormat openOther) {
    RawMesh raw;
    DeclaredSize info;
    if (format == VtkFormat::xml) info = checkXmlFile(path, allowedFolder(path, options));
    if (format == VtkFormat::legacy) checkLegacyFile(path);
    if (format == VtkFormat::xml && info.type == "UnstructuredGrid")
        if (std::optional<RawMesh> plain = readPlainVtu(path, options, execution)) return std::move(*plain);
    const auto open = [&] {
        return format == VtkFormat::xml      ? openXml(path, info)
               : format == VtkFormat::legacy ? openLegacy(path)
                                             : openOther(path, format, options);
    };
    std::vector<ArrayInfo> unread;
    read(
        path, info, open, options,
        [&](vtkDataObject* data, const VtkSource& source) {
            appendVtkData(path, data, source.nodeIds, options, execution, raw);
        },
        raw.statistics, unread);
    if (!raw.blocks.empty())
        raw.blocks.front().arrays.insert(raw.blocks.front().arrays.end(), unread.begin(), unread.end());
    return raw;
}

RawSurface readPolygons(const std::string& path, VtkFormat format, const ReadOptions& options,
                        const Execution& execution) {
    DeclaredSize info;
    if (format == VtkFormat::xml)
        info = checkXmlFile(path, allowedFolder(path, options));
    else
        checkLegacyFile(path);
    RawSurface raw;
    ImportStatistics statistics;
    std::vector<ArrayInfo> unread;
    read(
        path, info, [&] { return format == VtkFormat::xml ? openXml(path, info) : openLegacy(path); },
        options,
        [&](vtkDataObject* data, const VtkSource&) { raw = surfaceOf(path, data, options, execution); },
        statistics, unread);
    raw.format = statistics.format;
    raw.warnings.insert(raw.warnings.end(), statistics.warnings.begin(), statistics.warnings.end());
    return raw;
}

/// What libraries throw on damaged files, as errors of the file.
template <class Read>
auto explainErrors(const std::string& path, const Read& readIt) {
    try {
        return readIt();
    } catch (const std::bad_alloc&) {
        throw TooLargeError(path + ": damaged or too large: reading it asked for more memory than there is");
    } catch (const std::length_error&) {
        throw InputError(path + ": damaged: it declares an impossible size");
    } catch (const InternalError&) {
        throw;
    } catch (const std::logic_error&) {  // VTK's readers take for granted that names are there
        throw InputError(path + ": damaged: it lacks what a file of its format holds");
    }
}

}  // namespace

RawMesh readVtk(const std::string& path, VtkFormat format, const ReadOptions& options,
                const Execution& execution, OpenVtkFormat openOther) {
    if (!openOther && format != VtkFormat::xml && format != VtkFormat::legacy)
        throw OtherFormatError(path + ": only VTK XML, legacy VTK and TetGen files are read here");
    return explainErrors(path, [&] { return readCells(path, format, options, execution, openOther); });
}

RawSurface readVtkSurface(const std::string& path, VtkFormat format, const ReadOptions& options,
                          const Execution& execution) {
    return explainErrors(path, [&] { return readPolygons(path, format, options, execution); });
}

}  // namespace tessera
