#pragma once

#include <functional>
#include <string>

namespace tessera {

/// What was typed.
struct CommandLine {
    std::function<int()>
        run;           ///< the command: gives the exit code; empty when help or the version was asked for
    std::string text;  ///< that help or version
};

/// Throws InputError for words that no command takes.
CommandLine parseCommandLine(int argc, char** argv);

}  // namespace tessera
