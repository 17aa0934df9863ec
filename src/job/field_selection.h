#pragma once

#include <string>
#include <vector>

#include "tessera/mesh.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// A field of the mesh and the name of its grid.
struct FieldChoice {
    std::string source;
    std::string name;
    bool named = false;  ///< the name was given
};

/// Names to ask a reader for: those of the choices. Empty: all.
std::vector<std::string> sourceNames(const std::vector<FieldChoice>& choices,
                                     const std::vector<std::string>& errorFields);

/// The chosen fields: indices into mesh.fields, and how each is named in the output.
struct FieldSelection {
    std::vector<int> fields;
    std::vector<OutputField> outputs;
    int channels = 0;
};

/// No choices: every field; a cell field with the name of a point field gets "_cell" appended. A choice may
/// say "point:T" or "cell:T"; without, the point field is taken where there are both. Throws InputError
/// listing the fields there are when one is missing.
FieldSelection selectFields(const TetMesh& mesh, const std::vector<FieldChoice>& choices);

/// Index into mesh.fields of the field that one of a file was made from; -1 when there is none of that name,
/// place and number of components.
int findSource(const TetMesh& mesh, const OutputField& output);

}  // namespace tessera
