#include "library/field_choice.h"

#include <algorithm>
#include <numeric>
#include <set>

#include "mesh_files/read_mesh.h"
#include "tessera/error.h"

namespace tessera {

int chosenField(const TetMesh& mesh, const std::vector<int>& fields, const std::string& name) {
    int found = -1;
    std::string there;
    for (const int f : fields) {
        const Field& field = mesh.fields[std::size_t(f)];
        there += (there.empty() ? "" : ", ") + field.name;
        if (isFieldCalled(name, field.name, field.location) &&
            (found < 0 || field.location == FieldLocation::point))
            found = f;
    }
    if (found < 0)
        throw InputError("no field named '" + name + "'; there are: " + (there.empty() ? "none" : there));
    return found;
}

ChosenFields chooseFields(const TetMesh& mesh, const std::vector<std::string>& names) {
    std::vector<int> all(mesh.fields.size());
    std::iota(all.begin(), all.end(), 0);
    ChosenFields chosen;
    if (names.empty()) chosen.fields = all;
    for (const std::string& name : names) {
        const int f = chosenField(mesh, all, name);
        if (std::find(chosen.fields.begin(), chosen.fields.end(), f) != chosen.fields.end())
            throw InputError("the field '" + name + "' is named twice");
        chosen.fields.push_back(f);
    }
    std::set<std::string> taken;
    for (const int f : chosen.fields) {
        const Field& field = mesh.fields[std::size_t(f)];
        std::string name = field.name;
        if (taken.contains(name)) name += field.location == FieldLocation::cell ? "_cell" : "_point";
        while (!taken.insert(name).second) name += "_";
        chosen.described.push_back({name, field.location, field.components, chosen.channels});
        chosen.channels += field.components;
    }
    return chosen;
}

}  // namespace tessera
