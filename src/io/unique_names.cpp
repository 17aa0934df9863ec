#include "io/unique_names.h"

#include <algorithm>
#include <set>
#include <string_view>

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

void visit(vtkXMLDataElement* element, RenamedFields& renamed) {
    const std::string_view name = element->GetName() ? element->GetName() : "";
    if (name == "PointData" || name == "CellData") return renameArrays(element, renamed);
    for (int i = 0; i < element->GetNumberOfNestedElements(); ++i)
        visit(element->GetNestedElement(i), renamed);
}

}  // namespace

void makeNamesUnique(vtkXMLDataElement* file, RenamedFields& renamed) {
    visit(file, renamed);
}

}  // namespace tessera
