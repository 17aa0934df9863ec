#pragma once

#include <string>
#include <vector>

#include "job/render_scene.h"

namespace tessera {

/// What `tessera render` is asked for when it is to draw several pictures: of a camera that moves, of files
/// of a series, one a picture, or both.
struct FramesRequest {
    RenderRequest
        picture;  ///< of each; its output is a pattern as numberedName() has it, or gets _0001 and so on
    std::vector<std::string> inputs;  ///< at least one; of several each is one picture
    std::string path;                 ///< a file of key frames; empty: the scene's camera
    bool orbits = false;              ///< the scene's camera turns once around what it looks at
    std::optional<int> frames;        ///< none: one an input
};

struct RenderedFrames {
    std::vector<std::string> outputs;
    RenderedPicture last;
    double drawMs = 0;  ///< of all
};

/// Files are written one by one, whole; those that were written stay when the job is cancelled. The first
/// picture has number 1. Throws as renderScene() does, and InputError for a request that doesn't say how many
/// pictures.
RenderedFrames renderFrames(const FramesRequest& request, Job& job);
Json framesJson(const FramesRequest& request, const RenderedFrames& frames);

}  // namespace tessera
