#pragma once

#include <string>

#include "job/job.h"
#include "job/run_report.h"
#include "options.h"
#include "progress.h"

namespace tessera {

/// The hidden subcommand that reads a mesh for another tessera process.
inline constexpr const char* kReadMeshCommand = "read-mesh";
/// To be called first in main: what is known of the process before it does anything.
void noteStart();

/// This program's own file.
const std::string& programPath();

/// Prints to standard output at once; what goes wrong is kept.
void printOut(const std::string& text);
/// errno of the first thing that couldn't be printed; 0 as long as all could.
int outputError();

/// A job on the command line: the flag that a signal raises stops it, a line shows its progress, and what it
/// says is printed.
class Session {
  public:
    /// @param output what the command writes: for "-" nothing else is printed to standard output. Throws
    /// InputError for options that contradict each other.
    explicit Session(const CommonOptions& options, const std::string& output = {});
    Job job;

    /// Writes a document where --json says, a file that appears when it is whole or standard output; nothing
    /// without --json. Throws IoError.
    void writeReport(const Json& document) const;

    /// For a run that did all it was to do: 0, or with --strict 3 after a result that isn't what was asked
    /// for.
    int exitCode() const;

  private:
    void print(const std::string& text) const;

    ProgressLine progress_;
    bool strict_, prints_;
    bool fellShort_ = false;
};

}  // namespace tessera
