#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <limits>
#include <new>
#include <sstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "commands.h"
#include "interrupt.h"
#include "io/atomic_file.h"
#include "output_paths.h"
#include "report_text.h"

namespace {

constexpr int kExitFailure = 1;
constexpr int kExitBadInput = 2;

/// One line on standard error, whatever the message holds. Where it can't be written the exit code has to do.
void printError(const char* message) {
    std::fputs(("tessera: " + tessera::singleLine(message) + "\n").c_str(), stderr);
}

struct Arguments {
    tessera::ResampleArguments resample;
    tessera::InfoArguments info;
    tessera::VerifyArguments verify;
    tessera::TetsArguments tets;
    tessera::PictureArguments picture;
    tessera::CompareArguments compare;
    tessera::PaperTablesArguments paperTables;
    tessera::SliceArguments slice;
};

void describe(CLI::App& app, Arguments& arguments) {
    app.name("tessera");
    app.set_version_flag("--version", fmt::format("tessera {}", TESSERA_VERSION));
    app.set_help_flag("-h,--help", "print this help and exit");
    app.require_subcommand(1);
    app.get_formatter()->column_width(34);
    app.footer(
        "Example:\n  tessera resample flow.vtu -o flow.vdb\n'tessera <command> --help' tells more. Exit "
        "codes: 0 done, "
        "2 bad input or usage, 1 any other failure, 130 interrupted.");
    tessera::addResampleOptions(
        *app.add_subcommand("resample", "mesh file -> adaptive OpenVDB file, with an error report"),
        arguments.resample);
    tessera::addInfoOptions(
        *app.add_subcommand("info", "what a mesh file or a .vdb file holds, or what OpenGL there is"),
        arguments.info);
    tessera::addVerifyOptions(
        *app.add_subcommand("verify", "check a .vdb file's error report against its mesh"), arguments.verify);
    tessera::addTetsOptions(*app.add_subcommand("tets", "write the tetrahedra that a mesh is split into"),
                            arguments.tets);
    tessera::addPictureOptions(*app.add_subcommand("picture", "draw one slice of a .vdb file as a .png"),
                               arguments.picture);
    tessera::addCompareOptions(
        *app.add_subcommand("compare", "several algorithms on one lattice: coverage, values, times"),
        arguments.compare);
    tessera::addPaperTablesOptions(
        *app.add_subcommand("paper-tables", "the algorithms' times beside those of the paper they come from"),
        arguments.paperTables);
    tessera::addSliceOptions(*app.add_subcommand("slice", "cut a mesh with any plane: a float EXR or a .png"),
                             arguments.slice);
    for (CLI::App* command : app.get_subcommands({}))
        if (CLI::Option* step = command->get_option_no_throw("--time-step"))
            step->check(CLI::Range(0, std::numeric_limits<int>::max()));
}

/// What is printed must never reach a file that happens to get the number of a closed stream: such streams
/// are opened so that writing to them fails.
void holdClosedStreams() {
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        if (::fcntl(stream, F_GETFD) < 0) ::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}

/// The exit code, which is that of a failure when standard output couldn't take all that was printed.
int codeAfterOutput(int code) {
    const int error = tessera::outputError();
    if (error == 0) return code;
    if (error != EPIPE)  // whoever reads has seen enough
        printError(fmt::format("standard output: {}", std::strerror(error)).c_str());
    return code == 0 ? kExitFailure : code;
}

int run(const CLI::App& app, const Arguments& arguments) {
    if (app.got_subcommand("resample")) return tessera::runResample(arguments.resample);
    if (app.got_subcommand("info")) return tessera::runInfo(arguments.info);
    if (app.got_subcommand("verify")) {
        const tessera::VerifyArguments& verify = arguments.verify;
        tessera::checkOutputPaths({verify.meshPath, verify.vdbPath}, {{"--json", verify.common.jsonPath}});
        return tessera::runVerify(verify);
    }
    if (app.got_subcommand("tets")) return tessera::runTets(arguments.tets);
    if (app.got_subcommand("slice")) return tessera::runSlice(arguments.slice);
    if (app.got_subcommand("compare")) return tessera::runCompare(arguments.compare);
    if (app.got_subcommand("paper-tables")) return tessera::runPaperTables(arguments.paperTables);
    return tessera::runPicture(arguments.picture);
}

/// What the process that reads a mesh runs; another tessera process is its only user.
int readMeshForParent(const std::vector<std::string>& words) {
    try {
        return tessera::runReadMesh(words);
    } catch (const tessera::InputError& error) {
        printError(error.what());
        return kExitBadInput;
    } catch (const std::exception& error) {
        printError(error.what());
    }
    return kExitFailure;
}

/// Libraries allocate in destructors, where a failure ends the program: in order, without unfinished files.
[[noreturn]] void endOutOfMemory() {
    std::string line = "an exception escaped";
    try {
        if (const std::exception_ptr failure = std::current_exception()) std::rethrow_exception(failure);
    } catch (const std::bad_alloc&) {
        line = "out of memory";
    } catch (const std::exception& error) {
        line = error.what();
    } catch (...) {
    }
    tessera::removeTemporaryFiles();
    printError(line.c_str());
    _exit(kExitFailure);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc > 1 && std::string(argv[1]) == tessera::kReadMeshCommand)
        _exit(readMeshForParent({argv + 2, argv + argc}));
    holdClosedStreams();
    tessera::noteStart();
    tessera::installInterruptHandlers();
    std::set_terminate(endOutOfMemory);
    CLI::App app("Resamples simulation meshes into adaptive bricks of voxels.");
    Arguments arguments;
    describe(app, arguments);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        if (error.get_exit_code() == 0) {  // --help, --version
            std::ostringstream text;
            app.exit(error, text);
            tessera::printOut(text.str());
            return codeAfterOutput(0);
        }
        printError(fmt::format("{} (tessera --help tells more)", error.what()).c_str());
        return kExitBadInput;
    }
    try {
        return codeAfterOutput(run(app, arguments));
    } catch (const tessera::Cancelled&) {
        printError("interrupted; no unfinished file is left");
        return 128 + tessera::interruptSignal();
    } catch (const tessera::InputError& error) {
        printError(error.what());
        return kExitBadInput;
    } catch (const std::bad_alloc&) {
        printError("out of memory");
    } catch (const std::exception& error) {
        printError(error.what());
    }
    return kExitFailure;
}
