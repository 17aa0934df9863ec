#pragma once

#include <string>
#include <vector>

#include "options.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// The programs that --for knows.
std::vector<std::string> programNames();

/// The arguments with what wasn't given filled in: for the program named by --for, or else the defaults.
/// Throws InputError when an option contradicts the program.
ResampleArguments settleProgram(ResampleArguments arguments);

/// Gives fields the names that a program looks for: of density to the first field of one component, of
/// velocity to the first of three that is called so. Leaves alone what --field named, and does nothing where
/// a field has the name already. Gives lines for the user that say what was named.
/// @param outputs one for each of `choices`, unless there are none. @param program empty: nothing is done.
std::string nameFields(std::vector<OutputField>& outputs, const std::vector<FieldChoice>& choices,
                       const std::string& program);

}  // namespace tessera
