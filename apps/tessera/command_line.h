#pragma once

#include <string>

#include "commands.h"

namespace tessera {

/// What was typed: the command's name, and the arguments of every command.
struct CommandLine {
    std::string command;  ///< empty when help or the version was asked for
    std::string text;     ///< that help or version
    ResampleArguments resample;
    InfoArguments info;
    VerifyArguments verify;
    TetsArguments tets;
    PictureArguments picture;
    CompareArguments compare;
    PaperTablesArguments paperTables;
    SliceArguments slice;
};

/// Throws InputError for words that no command takes.
CommandLine parseCommandLine(int argc, char** argv);

}  // namespace tessera
