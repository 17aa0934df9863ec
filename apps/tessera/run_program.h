#pragma once

#include <functional>
#include <string>
#include <vector>

#include "command_line.h"

namespace tessera {

/// What messages begin with: the name of the program that runs.
const std::string& programName();

/// One line on standard error, whatever the message holds. Where it can't be written the exit code has to do.
void printError(const char* message);

/// All that a program on the command line does, in order: streams and signals, what was typed, the work, and
/// its errors as one line. Returns the exit code.
int runProgram(const char* name, const std::function<CommandLine()>& parse);

/// What a process that another one starts runs. Returns the exit code.
int serveParent(const std::vector<std::string>& words, int (*serve)(const std::vector<std::string>&));

}  // namespace tessera
