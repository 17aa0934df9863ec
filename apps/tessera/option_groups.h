#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "command_line.h"
#include "options.h"

namespace tessera {

/// Numbers from `first` to `last`; says so in plain figures.
CLI::Validator numbersWithin(double first, double last);

/// Above 0, in world units.
CLI::Validator isLength();

/// --threads, --quiet and --json.
void addRunOptions(CLI::App& command, CommonOptions& options);

/// The name, --help and --version. @param version what the last prints.
void nameProgram(CLI::App& app, const std::string& name, const std::string& version);

/// Takes what was typed, or makes it the text of the help or the version. Throws InputError.
void parseWords(CLI::App& app, int argc, char** argv, CommandLine& line);

}  // namespace tessera
