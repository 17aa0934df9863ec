#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <string>
#include <vector>

#include "command_line.h"
#include "files/atomic_file.h"
#include "gl/gl_trial.h"
#include "interrupt.h"
#include "job/wrap_text.h"
#include "progress.h"
#include "reader/isolated_vdb.h"
#include "session.h"
#include "tessera/error.h"

namespace {

constexpr int kExitFailure = 1;
constexpr int kExitBadInput = 2;

/// One line on standard error, whatever the message holds. Where it can't be written the exit code has to do.
void printError(const char* message) {
    const auto pause = tessera::pauseProgress();
    std::fputs(("tessera: " + tessera::messageLine(message) + "\n").c_str(), stderr);
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

int run(const tessera::CommandLine& line) {
    if (line.run) return line.run();
    tessera::printOut(line.text);
    return 0;
}

/// What a process that another tessera starts runs.
int serveParent(const std::vector<std::string>& words, int (*serve)(const std::vector<std::string>&)) {
    try {
        return serve(words);
    } catch (const tessera::InputError& error) {
        printError(error.what());
        return kExitBadInput;
    } catch (const std::exception& error) {
        printError(error.what());
    }
    return kExitFailure;
}

int readForParent(const std::vector<std::string>& words) {
    std::vector<tessera::ReaderTask> tasks = tessera::vdbTasks();
    tasks.push_back(tessera::meshTask());
    return tessera::serveReader(words, tasks);
}

int tryGlForParent(const std::vector<std::string>& words) {
    return tessera::serveGlTrial(words);
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
    const std::string command = argc > 1 ? argv[1] : "";
    if (command == tessera::kReadMeshCommand) _exit(serveParent({argv + 2, argv + argc}, readForParent));
    if (command == tessera::kTryGlCommand) return serveParent({argv + 2, argv + argc}, tryGlForParent);
    holdClosedStreams();
    tessera::noteStart();
    tessera::installInterruptHandlers();
    std::set_terminate(endOutOfMemory);
    ::setenv("EGL_LOG_LEVEL", "fatal", 0);  // what drivers lack is told by us, in one line
    try {
        return codeAfterOutput(run(tessera::parseCommandLine(argc, argv)));
    } catch (const tessera::Cancelled&) {
        printError("interrupted; no unfinished file is left");
        return 128 + tessera::interruptSignal();
    } catch (const tessera::InputError& error) {
        printError(error.what());
        return kExitBadInput;
    } catch (const std::bad_alloc&) {
        printError("out of memory");
    } catch (const tessera::OutputClosed&) {  // whoever reads has seen enough
    } catch (const std::exception& error) {
        printError(error.what());
    }
    return kExitFailure;
}
