#pragma once

#include <optional>
#include <string>
#include <vector>

#include "job/field_selection.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// The programs that --for knows.
std::vector<std::string> programNames();

/// What a program decides about a file unless it was given, as typed.
struct ProgramChoices {
    std::string layout;  ///< "levels" or "flat"; empty: not given
    std::string upAxis;  ///< "keep", "y" or "z"; empty: not given
    std::optional<int> extendLayers;
    std::optional<double> voxelShift;
};

/// The choices with what wasn't given filled in for the program named by --for; empty: nothing is done.
/// Throws InputError when a choice contradicts the program.
ProgramChoices settleProgram(const std::string& program, ProgramChoices choices);

/// Gives fields the names that a program looks for: of density to the first field of one component, of
/// velocity to the first of three that is called so. Leaves alone what --field named, and does nothing where
/// a field has the name already. Gives lines for the user that say what was named.
/// @param outputs one for each of `choices`, unless there are none. @param program empty: nothing is done.
std::string nameFields(std::vector<OutputField>& outputs, const std::vector<FieldChoice>& choices,
                       const std::string& program);

}  // namespace tessera
