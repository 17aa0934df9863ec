// The window: tessera-view [file] [--scene scene.json] ... ; `tessera view` starts it.

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <vector>

#include "base/text.h"
#include "gl/gl_platform.h"
#include "reader/isolated_tetrahedra.h"
#include "tessera/error.h"
#include "window.h"

namespace {

volatile std::sig_atomic_t wasInterrupted = 0;

/// The first word of the process that tries whether a window can be opened.
constexpr const char* kTryWindowCommand = "try-window";
constexpr int kExitFailure = 1;
constexpr int kExitBadInput = 2;

void printError(const char* message) {
    std::fputs(("tessera: " + tessera::messageLine(message) + "\n").c_str(), stderr);
}

/// How the display's driver crashed or stalled in a process that tried it; empty where it didn't.
std::string windowFault() {
    using namespace tessera;
    const std::vector<std::string> words{"window"};
    const GlTrialResult result = tryDrivers({"/proc/self/exe", {kTryWindowCommand}}, words)[0];
    return result.isFault ? result.reason : std::string();
}

int view(int argc, char** argv) {
    using namespace tessera;
    CLI::App app("Shows a mesh or a .vdb file in a window: bricks refine around the focus.");
    app.name("tessera view");
    std::string input, scene, field, gl, program;
    std::optional<int> component;
    WindowOptions window;
    ViewOptions options;
    int threads = 0;
    app.add_option("input", input, "a mesh or a .vdb file (default: drop one onto the window)");
    app.add_option("--scene", scene, "a scene to begin with");
    app.add_option("--field", field, "the field (default: the scene's, or the first)");
    app.add_option("--component", component, "component of a vector, counted from 0 (default: its length)")
        ->check(CLI::Range(0, 8));
    app.add_option("--width", window.width, "of the window (default: 1280)")->check(CLI::Range(480, 16384));
    app.add_option("--height", window.height, "of the window (default: 800)")->check(CLI::Range(320, 16384));
    app.add_option(
           "--frame-time", options.frameMs,
           "milliseconds that a picture may take while something moves (default: 33, or 100 where the "
           "processor draws)")
        ->check(CLI::Range(1.0, 10000.0));
    app.add_option("--save-scene", window.scenePath, "where Ctrl S saves the scene (default: scene.json)");
    app.add_option("--save-picture", window.picturePath,
                   "where Ctrl P saves the picture (default: picture.png)");
    app.add_flag("--light", window.isLight, "a light interface");
    app.add_option("--gl", gl, "OpenGL platform that draws (default: the first that can be had)")
        ->check(CLI::IsMember({"egl-device", "egl-surfaceless", "osmesa"}));
    app.add_option("--threads", threads, "worker threads (default: one for every processor)")
        ->check(CLI::Range(0, 1024));
    app.add_option("--reader", program,
                   "the tessera program, which reads meshes in a process of its own "
                   "(default: the one beside this program)")
        ->group("");
    try {
        app.parse(argc, argv);
    } catch (const CLI::CallForHelp&) {
        std::fputs(app.help().c_str(), stdout);
        return 0;
    } catch (const CLI::ParseError& error) {
        throw InputError(error.what());
    }
    Job job;
    job.execution.threads = threads;
    if (program.empty()) program = programBeside("/proc/self/exe", "tessera");
    if (!program.empty()) {
        const std::string quick = quickReaderBeside(program);
        job.reader = {program, {"read-mesh"}, quick};
        job.tetrahedralizer = tetrahedralizerBeside(program);
        tryGlFirst({quick.empty() ? program : quick, {kTryGlCommand}});
    }
    if (!gl.empty()) options.platform = parseGlPlatform(gl);
    SceneDocument document = scene.empty() ? SceneDocument() : SceneDocument::read(scene);
    if (!field.empty() || component) {
        SceneDocument::Json json = document.json();
        if (!field.empty()) json["field"] = field;
        if (component) json["component"] = *component;
        document.change(std::move(json), false);
    }
    std::error_code error;
    if (!input.empty() && !std::filesystem::exists(input, error))
        throw InputError(input + ": there is no such file");
    ViewSession session(job, options);
    session.document() = std::move(document);
    if (!input.empty()) session.open(input);  // read while the window opens
    if (const std::string fault = windowFault(); !fault.empty())
        throw GlError("no window can be opened: " + fault);
    Window shown(session, window);
    std::signal(SIGINT, [](int) { wasInterrupted = 1; });
    std::signal(SIGTERM, [](int) { wasInterrupted = 1; });
    shown.run([] { return wasInterrupted != 0; });
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    try {
        if (argc > 1 && std::string(argv[1]) == kTryWindowCommand)
            return tessera::serveTrial(std::vector<std::string>(argv + 2, argv + argc),
                                       [](const std::string&) {
                                           tessera::tryWindow();
                                           return std::string("a window");
                                       });
        return view(argc, argv);
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
