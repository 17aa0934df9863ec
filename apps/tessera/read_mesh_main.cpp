// The program that reads meshes of common formats for Tessera's isolated reader, and tries OpenGL for it. It
// links no more than that takes, so that it starts in a hundredth of a second.
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <span>
#include <string>
#include <vector>

#include "gl/gl_trial.h"
#include "reader/serve_reader.h"

int main(int argc, char** argv) {
    try {
        const std::vector<std::string> request(argv + std::min(argc, 1), argv + argc);
        if (!request.empty() && request[0] == tessera::kTryGlCommand)
            return tessera::serveGlTrial(std::span(request).subspan(1));
        const std::vector<tessera::ReaderTask> tasks{tessera::meshTask(tessera::readCommonMesh)};
        const int code = tessera::serveReader(request, tasks);
        ::_exit(code);  // libraries have nothing to tidy up
    } catch (const std::exception& error) {
        std::fprintf(stderr, "tessera_read_mesh: %s\n", error.what());
        return 2;
    }
}
