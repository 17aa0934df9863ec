#include "field_selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "base/error.h"

namespace tessera {

namespace {

std::string withoutLocation(const std::string& name) {
    if (name.starts_with("point:")) return name.substr(6);
    if (name.starts_with("cell:")) return name.substr(5);
    return name;
}

bool matches(const Field& field, const std::string& name) {
    if (field.name == name) return true;
    const bool onPoints = field.location == FieldLocation::point;
    return (name.starts_with("point:") && onPoints && name.substr(6) == field.name) ||
           (name.starts_with("cell:") && !onPoints && name.substr(5) == field.name);
}

int findAmong(const TetMesh& mesh, const std::vector<int>& fields, const std::string& name) {
    int found = -1;
    for (const int f : fields) {
        const Field& field = mesh.fields[std::size_t(f)];
        if (matches(field, name) && (found < 0 || field.location == FieldLocation::point)) found = f;
    }
    if (found >= 0) return found;
    std::string there;
    for (const int f : fields) there += (there.empty() ? "" : ", ") + mesh.fields[std::size_t(f)].name;
    throw InputError(fmt::format("no field named '{}'; there are: {}", name, there.empty() ? "none" : there));
}

std::vector<int> everyField(const TetMesh& mesh) {
    std::vector<int> all(mesh.fields.size());
    std::iota(all.begin(), all.end(), 0);
    return all;
}

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
    for (const FieldChoice& choice : choices) names.push_back(withoutLocation(choice.source));
    for (const std::string& name : errorFields) names.push_back(withoutLocation(name));
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
        const int f = findAmong(mesh, all, choice.source);
        add(f, choice.name == choice.source ? withoutLocation(choice.name) : choice.name);
    }
    if (choices.empty())
        for (const int f : all) add(f, gridName(mesh, mesh.fields[std::size_t(f)], taken));
    return selection;
}

int findSelected(const TetMesh& mesh, const std::vector<int>& fields, const std::string& name) {
    return findAmong(mesh, fields, name);
}

}  // namespace tessera
