#pragma once

#include <set>
#include <string>

#include "options.h"
#include "progress.h"
#include "reader/isolated_reader.h"
#include "reader/reader_limits.h"

namespace tessera {

/// The hidden subcommand that reads a mesh for another tessera process.
inline constexpr const char* kReadMeshCommand = "read-mesh";
/// To be called first in main: what is known of the process before it does anything.
void noteStart();

/// Prints to standard output at once; what goes wrong is kept.
void printOut(const std::string& text);
/// errno of the first thing that couldn't be printed; 0 as long as all could.
int outputError();

/// What a command runs with: threads, the flag that a signal raises, a line of progress, how it reads, and
/// what it says.
class Session {
  public:
    /// @param output what the command writes: for "-" nothing else is printed to standard output.
    explicit Session(const CommonOptions& options, const std::string& output = {});
    Execution execution;
    ProgressLine progress;

    /// Reads a mesh, in a process of its own unless the options say otherwise; of a .pvd file the step that
    /// the options name. Throws as readMesh does.
    MeshFile readMesh(const std::string& path, const ReadOptions& options);

    /// Prints to standard output, unless quiet or a file or the JSON report goes there.
    void print(const std::string& text);

    /// Prints one line to standard error, unless quiet.
    void warn(const std::string& text);

    /// The result isn't what was asked for: one line on standard error, quiet or not, and what --strict is
    /// for.
    void warnFellShort(const std::string& text);

    /// What of an import's warnings wasn't said before, on another step of the series.
    std::vector<std::string> unsaid(const std::vector<std::string>& warnings);

    /// Largest memory of the run: of this process, or, where that is more, of the one that read a mesh and
    /// this one together at that time.
    std::int64_t peakMemoryBytes() const;

    /// For a run that did all it was to do: 0, or with --strict 3 after warnFellShort.
    int exitCode() const;

  private:
    bool quiet_, strict_;
    bool prints_;
    bool isolated_;
    bool fellShort_ = false;
    std::int64_t readPeakBytes_ = 0;
    std::set<std::string> said_;
    IsolationLimits limits_;
};

struct InfoArguments {
    CommonOptions common;
    RepairArguments repair;
    std::vector<std::string> paths;  ///< a .vdb file, a mesh, or a series as resample takes it
    int timeStep = -1;
    bool gl = false;
};
struct VerifyArguments {
    CommonOptions common;
    std::string meshPath, vdbPath;
    int timeStep = -1;
};
struct TetsArguments {
    CommonOptions common;
    RepairArguments repair;
    std::string input, output;
    int timeStep = -1;
};
struct PictureArguments {
    CommonOptions common;
    std::string input, output, field, mesh, bounds, range, axis = "z";
    std::optional<double> at;
    std::optional<int> component;
    int pixels = 800;
    bool bricks = false;
};

struct SliceArguments {
    CommonOptions common;
    RepairArguments repair;
    AlgorithmArguments algorithm;
    std::string input, output, format, origin, normal = "0,0,1", up, size, fields, range;
    std::optional<int> component;
    int resolution = 1024;
    int timeStep = -1;
};
struct CompareArguments {
    CommonOptions common;
    RepairArguments repair;
    std::vector<std::string> meshes;
    std::string algorithms, fields;  ///< empty: all
    AlgorithmArguments algorithm;    ///< its name is not used
    std::optional<int> resolution;
    std::optional<double> spacing;
    int runs = 3, boxEdge = 128, timeStep = -1;
    bool markdown = false;
};
struct PaperTablesArguments {
    CommonOptions common;
    std::string mesh, field;
    AlgorithmArguments algorithm;  ///< its name is not used
    int runs = 3, maxSize = 1024;
    bool asPublished = false;
};

/// Each returns the exit code and throws the library's errors.
int runResample(const ResampleArguments& arguments);
int runInfo(const InfoArguments& arguments);
int runVerify(const VerifyArguments& arguments);
int runTets(const TetsArguments& arguments);
int runPicture(const PictureArguments& arguments);
int runCompare(const CompareArguments& arguments);
int runPaperTables(const PaperTablesArguments& arguments);
int runSlice(const SliceArguments& arguments);
/// @param words those behind kReadMeshCommand.
int runReadMesh(const std::vector<std::string>& words);

}  // namespace tessera
