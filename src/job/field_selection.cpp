#include "job/field_selection.h"

#include <algorithm>
#include <set>

#include "mesh_files/find_field.h"

namespace tessera {

namespace {

std::string gridName(const TetMesh& mesh, const Field& field, std::set<std::string>& taken) {
    std::string name = field.name;
    if (field.location == FieldLocation::cell &&
        std::any_of(mesh.fields.begin(), mesh.fields.end(), [&](const Field& other) {
            return other.location == FieldLocation::point && other.name == name;
        }))
        name += "_cell";
    while (!taken.insert(name).second) name += "_";
    return name;
}

}  // namespace

std::vector<std::string> sourceNames(const std::vector<FieldChoice>& choices,
                                     const std::vector<std::string>& errorFields) {
    std::vector<std::string> names;
    if (choices.empty()) return names;
    for (const FieldChoice& choice : choices) names.push_back(choice.source);
    names.insert(names.end(), errorFields.begin(), errorFields.end());
    std::sort(names.begin(), names.end());
    names.erase(std::unique(names.begin(), names.end()), names.end());
    return names;
}

FieldSelection selectFields(const TetMesh& mesh, const std::vector<FieldChoice>& choices) {
    FieldSelection selection;
    std::set<std::string> taken;
    const auto add = [&](int f, const std::string& name) {
        const Field& field = mesh.fields[std::size_t(f)];
        selection.fields.push_back(f);
        selection.outputs.push_back({name, field.name,
                                     field.location == FieldLocation::point ? "point" : "cell",
                                     field.components, selection.channels});
        selection.channels += field.components;
    };
    const std::vector<int> all = everyField(mesh);
    for (const FieldChoice& choice : choices) {
        const int f = findField(mesh, all, choice.source);
        add(f, choice.name == choice.source ? mesh.fields[std::size_t(f)].name : choice.name);
    }
    if (choices.empty())
        for (const int f : all) add(f, gridName(mesh, mesh.fields[std::size_t(f)], taken));
    return selection;
}

int findSource(const TetMesh& mesh, const OutputField& output) {
    const auto found = std::find_if(mesh.fields.begin(), mesh.fields.end(), [&](const Field& field) {
        return field.name == output.sourceName && field.components == output.components &&
               (field.location == FieldLocation::point) == (output.location == "point");
    });
    return found == mesh.fields.end() ? -1 : int(found - mesh.fields.begin());
}

}  // namespace tessera
