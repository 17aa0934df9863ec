#include <unistd.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "command_line.h"
#include "gl/gl_trial.h"
#include "reader/isolated_vdb.h"
#include "reader/serve_reader.h"
#include "run_program.h"
#include "session.h"

namespace {

int readForParent(const std::vector<std::string>& words) {
    std::vector<tessera::ReaderTask> tasks = tessera::vdbTasks();
    tasks.push_back(tessera::meshTask());
    return tessera::serveReader(words, tasks);
}

int tryGlForParent(const std::vector<std::string>& words) {
    return tessera::serveGlTrial(words);
}

}  // namespace

int main(int argc, char** argv) {
    const std::string command = argc > 1 ? argv[1] : "";
    if (command == tessera::kReadMeshCommand)
        _exit(tessera::serveParent({argv + 2, argv + argc}, readForParent));
    if (command == tessera::kTryGlCommand)
        return tessera::serveParent({argv + 2, argv + argc}, tryGlForParent);
    ::setenv("EGL_LOG_LEVEL", "fatal", 0);  // what drivers lack is told by us, in one line
    return tessera::runProgram("tessera", [&] { return tessera::parseCommandLine(argc, argv); });
}
