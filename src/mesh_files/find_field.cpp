#include "mesh_files/find_field.h"

#include "mesh_files/read_mesh.h"
#include "tessera/error.h"

namespace tessera {

int findField(const TetMesh& mesh, const std::vector<int>& among, const std::string& called) {
    int found = -1;
    std::string there;
    for (const int f : among) {
        const Field& field = mesh.fields[std::size_t(f)];
        there += (there.empty() ? "" : ", ") + field.name;
        if (isFieldCalled(called, field.name, field.location) &&
            (found < 0 || field.location == FieldLocation::point))
            found = f;
    }
    if (found < 0)
        throw InputError("no field named '" + called + "'; there are: " + (there.empty() ? "none" : there));
    return found;
}

}  // namespace tessera
