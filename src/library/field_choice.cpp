#include "library/field_choice.h"

#include <algorithm>
#include <set>

#include "mesh_files/find_field.h"
#include "tessera/error.h"

namespace tessera {

ChosenFields chooseFields(const TetMesh& mesh, const std::vector<std::string>& names) {
    const std::vector<int> all = everyField(mesh);
    ChosenFields chosen;
    if (names.empty()) chosen.fields = all;
    for (const std::string& name : names) {
        const int f = findField(mesh, all, name);
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
