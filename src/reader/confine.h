#pragma once

#include <span>
#include <string>

namespace tessera {

/// What a process can give up on this system.
struct Confinement {
    bool files = false;  ///< by Landlock: writing, running programs, reading outside given folders
    bool calls = false;  ///< by seccomp: the network, running programs, looking into other processes
};

/// What there is; gives up nothing.
Confinement availableConfinement();

/// Gives that up for good, for the calling thread and those that it starts, as far as there is it. Files that
/// are open stay so. Besides what is given, libraries and what the kernel says of this process can be read.
/// @param readable files, and folders with all below; those that don't exist are left out.
void confine(std::span<const std::string> readable);

}  // namespace tessera
