#include "run_program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>

#include "files/atomic_file.h"
#include "interrupt.h"
#include "job/wrap_text.h"
#include "progress.h"
#include "session.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kExitFailure = 1;
constexpr int kExitBadInput = 2;

std::string name = "tessera";

/// What is printed must never reach a file that happens to get the number of a closed stream: such streams
/// are opened so that writing to them fails.
void holdClosedStreams() {
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        if (::fcntl(stream, F_GETFD) < 0) ::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}

/// The exit code, which is that of a failure when standard output couldn't take all that was printed.
int codeAfterOutput(int code) {
    const int error = outputError();
    if (error == 0) return code;
    if (error != EPIPE)  // whoever reads has seen enough
        printError(fmt::format("standard output: {}", std::strerror(error)).c_str());
    return code == 0 ? kExitFailure : code;
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
    removeTemporaryFiles();
    printError(line.c_str());
    _exit(kExitFailure);
}

}  // namespace

const std::string& programName() {
    return name;
}

void printError(const char* message) {
    const auto pause = pauseProgress();
    std::fputs((name + ": " + messageLine(message) + "\n").c_str(), stderr);
}

int serveParent(const std::vector<std::string>& words, int (*serve)(const std::vector<std::string>&)) {
    try {
        return serve(words);
    } catch (const InputError& error) {
        printError(error.what());
        return kExitBadInput;
    } catch (const std::exception& error) {
        printError(error.what());
    }
    return kExitFailure;
}

int runProgram(const char* programsName, const std::function<CommandLine()>& parse) {
    name = programsName;
    holdClosedStreams();
    noteStart();
    installInterruptHandlers();
    std::set_terminate(endOutOfMemory);
    try {
        const CommandLine line = parse();
        if (!line.run) printOut(line.text);
        return codeAfterOutput(line.run ? line.run() : 0);
    } catch (const Cancelled&) {
        printError("interrupted; no unfinished file is left");
        return 128 + interruptSignal();
    } catch (const InputError& error) {
        printError(error.what());
        return kExitBadInput;
    } catch (const std::bad_alloc&) {
        printError("out of memory");
    } catch (const OutputClosed&) {  // whoever reads has seen enough
    } catch (const std::exception& error) {
        printError(error.what());
    }
    return kExitFailure;
}

}  // namespace tessera
