#pragma once

#include <string>
#include <vector>

#include "job/job.h"

namespace tessera {

/// A file that a command writes, and the option that named it.
struct OutputPath {
    std::string option;
    std::string path;
};

/// What an output is to be: the ending of its name without the dot, in lower case; for standard output, "-",
/// what --format says, or the first kind when that is empty. Throws InputError that lists the kinds for any
/// other ending, and for a --format that stands beside a name.
std::string chooseFormat(const std::string& output, const std::string& format,
                         const std::vector<std::string>& kinds);

/// Throws InputError when an output is the same file as an input, one that a .pvd file among them names, or
/// another output, under whatever name: links and relative paths are followed; and when two outputs are "-",
/// standard output. Empty paths are passed over.
void checkOutputPaths(const std::vector<std::string>& inputs, const std::vector<OutputPath>& outputs);

/// checkWritable for the file of the job's document, where there is to be one.
void checkReportPath(const Job& job);

}  // namespace tessera
