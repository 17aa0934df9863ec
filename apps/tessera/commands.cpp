#include "commands.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "job/resample_files.h"
#include "session.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kExitDisagree = 1;

CutOptions cutOptions(const SliceArguments& a) {
    CutOptions options = a.request.cut;
    if (!a.origin.empty()) options.originWorld = parseVector("--origin", a.origin);
    options.normal = parseVector("--normal", a.normal);
    if (!a.up.empty()) options.up = parseVector("--up", a.up);
    if (!a.size.empty()) {
        const bool square = a.size.find(',') == std::string::npos;
        const std::vector<double> size = parseNumbers("--size", a.size, square ? 1 : 2);
        options.sizeWorld = {size.front(), size.back()};
    }
    checkCutOptions(options);
    return options;
}

}  // namespace

int runResample(const ResampleArguments& a) {
    const ResampleRequest request = resampleRequest(a);
    Session session(a.common, request.dryRun ? std::string() : request.output);
    session.writeReport(resampleFiles(request, session.job));
    return session.exitCode();
}

int runInfo(const InfoArguments& a) {
    DescribeRequest request = a.request;
    request.repair = repairOptions(a.repair);
    Session session(a.common);
    session.writeReport(describeFiles(request, session.job));
    return 0;
}

int runVerify(const VerifyArguments& a) {
    Session session(a.common);
    const Verification verification = verifyFile(a.request, session.job);
    session.writeReport(verifyJson(a.request, verification));
    if (!verification.holds())
        throw InputError(
            fmt::format("{}: its claims do not hold for {}", a.request.vdbPath, a.request.meshPath));
    return 0;
}

int runTets(const TetsArguments& a) {
    TetsRequest request = a.request;
    request.repair = repairOptions(a.repair);
    Session session(a.common, request.output);
    session.writeReport(tetsJson(request, exportTets(request, session.job)));
    return 0;
}

int runPicture(const PictureArguments& a) {
    DrawRequest request = a.request;
    request.axis = a.axis == "x" ? 0 : a.axis == "y" ? 1 : 2;
    if (!a.bounds.empty()) request.boundsWorld = parseBounds(a.bounds);
    if (!a.range.empty()) request.range = parseRange("--range", a.range);
    Session session(a.common, request.output);
    session.writeReport(drawnJson(request, drawVdb(request, session.job)));
    return 0;
}

int runRender(const RenderArguments& a) {
    RenderRequest request = a.request;
    request.input = a.frames.inputs.front();
    if (!a.size.empty()) request.size = parsePictureSize("--size", a.size);
    if (!a.gl.empty()) request.platform = parseGlPlatform(a.gl);
    Session session(a.common, request.output);
    if (a.frames.inputs.size() > 1 || a.frames.frames || a.frames.orbits || !a.frames.path.empty()) {
        FramesRequest frames = a.frames;
        frames.picture = request;
        session.writeReport(framesJson(frames, renderFrames(frames, session.job)));
        return 0;
    }
    session.writeReport(renderedJson(request, renderScene(request, session.job)));
    return 0;
}

// A program of its own, so that this one needs no display's libraries.
int runView(const std::vector<std::string>& given) {
    std::error_code error;
    const std::filesystem::path self = std::filesystem::canonical(programPath(), error);
    const std::string program = (self.parent_path() / "tessera-view").string();
    std::vector<std::string> words{program, "--reader", self.string()};
    words.insert(words.end(), given.begin(), given.end());
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    ::execv(program.c_str(), pointers.data());
    throw IoError(
        fmt::format("{}: the program with the window can't be started: {}", program, std::strerror(errno)));
}

int runSlice(const SliceArguments& a) {
    CutRequest request = a.request;
    request.cut = cutOptions(a);
    request.algorithm = a.algorithm.name;
    request.bind = bindOptions(a.algorithm);
    if (!a.fields.empty()) request.fields = parseFields(a.fields);
    if (!a.range.empty()) request.range = parseRange("--range", a.range);
    request.repair = repairOptions(a.repair);
    Session session(a.common, request.output);
    session.writeReport(cutJson(request, cutMesh(request, session.job), session.job));
    return 0;
}

int runFocusTrace(const FocusTraceArguments& a) {
    FocusTraceRequest request = a.request;
    request.budgetBytes = parseCount("--budget", a.budget, false);
    request.algorithm = a.algorithm.name;
    request.bind = bindOptions(a.algorithm);
    if (!a.fields.empty()) request.fields = parseFields(a.fields);
    request.repair = repairOptions(a.repair);
    Session session(a.common, request.output);
    session.writeReport(focusTraceJson(request, traceFocus(request, session.job), session.job));
    return session.exitCode();
}

int runCompare(const CompareArguments& a) {
    CompareRequest request = a.request;
    request.bind = bindOptions(a.algorithm);
    if (!a.fields.empty()) request.fields = parseFields(a.fields);
    request.repair = repairOptions(a.repair);
    Session session(a.common);
    const Comparison comparison = compareMeshes(request, session.job);
    session.writeReport(comparisonJson(comparison, session.job));
    for (const std::string& problem : comparison.problems) session.job.fellShort(problem);
    return comparison.problems.empty() ? 0 : kExitDisagree;
}

int runBench(const BenchArguments& a) {
    BenchmarkRequest request = a.request;
    constexpr std::string_view kGraded = "graded:";
    if (request.mesh.starts_with(kGraded)) {
        request.gradedElements = parseCount("graded:N", request.mesh.substr(kGraded.size()), false);
        if (request.gradedElements < 1 || request.gradedElements > 100'000'000)
            throw InputError("graded:N takes 1 to 100M elements");
        request.mesh.clear();
    }
    request.bind = bindOptions(a.algorithm);
    request.hasVtk = !a.withoutVtk;
    std::error_code error;
    request.program = std::filesystem::canonical(programPath(), error).string();
    for (const std::string& peer : a.peers) {
        const std::size_t equals = peer.find('=');
        if (equals == 0 || equals == std::string::npos || equals + 1 == peer.size())
            throw InputError(fmt::format("--peer: expected name=command, got '{}'", peer));
        request.peers.push_back({peer.substr(0, equals), peer.substr(equals + 1)});
    }
    Session session(a.common);
    session.writeReport(runBenchmark(request, session.job));
    return 0;
}

}  // namespace tessera
