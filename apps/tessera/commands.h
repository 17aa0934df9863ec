#pragma once

#include <string>

#include "benchmark/run_benchmark.h"
#include "job/compare_meshes.h"
#include "job/cut_mesh.h"
#include "job/describe_files.h"
#include "job/draw_vdb.h"
#include "job/export_tets.h"
#include "job/focus_trace.h"
#include "job/render_frames.h"
#include "job/render_scene.h"
#include "job/verify_file.h"
#include "options.h"

namespace tessera {

// What was typed behind each command: words that are still to be parsed, and what the job takes as it is.

struct InfoArguments {
    CommonOptions common;
    RepairArguments repair;
    DescribeRequest request;
};
struct VerifyArguments {
    CommonOptions common;
    VerifyRequest request;
};
struct TetsArguments {
    CommonOptions common;
    RepairArguments repair;
    TetsRequest request;
};
struct PictureArguments {
    CommonOptions common;
    std::string bounds, range, axis = "z";
    DrawRequest request;
};
struct RenderArguments {
    CommonOptions common;
    std::string size, gl;
    RenderRequest request;
    FramesRequest frames;
};
struct SliceArguments {
    CommonOptions common;
    RepairArguments repair;
    AlgorithmArguments algorithm;
    std::string origin, normal = "0,0,1", up, size, fields, range;
    CutRequest request;
};
struct FocusTraceArguments {
    CommonOptions common;
    RepairArguments repair;
    AlgorithmArguments algorithm;
    std::string fields, budget = "1G";
    FocusTraceRequest request;
};
struct CompareArguments {
    CommonOptions common;
    RepairArguments repair;
    AlgorithmArguments algorithm;  ///< its name is not used
    std::string fields;
    CompareRequest request;
};
struct BenchArguments {
    CommonOptions common;
    AlgorithmArguments algorithm;    ///< its platform alone is used
    std::vector<std::string> peers;  ///< "name=command"
    bool withoutVtk = false;
    BenchmarkRequest request;
};

/// Each returns the exit code and throws the library's errors.
int runResample(const ResampleArguments& arguments);
int runInfo(const InfoArguments& arguments);
int runVerify(const VerifyArguments& arguments);
int runTets(const TetsArguments& arguments);
int runPicture(const PictureArguments& arguments);
int runRender(const RenderArguments& arguments);
int runCompare(const CompareArguments& arguments);
int runBench(const BenchArguments& arguments);
/// @param words for the program that has the window.
int runView(const std::vector<std::string>& words);
int runSlice(const SliceArguments& arguments);
int runFocusTrace(const FocusTraceArguments& arguments);

}  // namespace tessera
