#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gl/gl_platform.h"
#include "gl/gl_thread.h"
#include "job/job.h"
#include "job/picture_source.h"
#include "job/run_report.h"
#include "mesh/field_range.h"
#include "render/slice_renderer.h"
#include "scene/scene.h"
#include "tessera/error.h"

namespace tessera {

/// What `tessera render` is asked for: a picture of the bricks of a .vdb file, or of a
/// mesh, made around the scene's focus. What is given here counts instead
/// of what the scene says.
struct RenderRequest {
    std::string input, output;  ///< output: a .png or .exr file; "-": a .png to standard output
    std::string scene;          ///< a file; empty: all defaults
    std::optional<std::string> field;
    std::optional<int> component;
    std::optional<std::array<int, 2>> size;  ///< pixels, right and down
    std::optional<int> samplesAPixel;
    std::optional<GlPlatform> platform;  ///< none: the best there is
    std::vector<std::string> without;    ///< effects of the scene to leave out
    bool explains = false;               ///< tells what each effect costs, and what it changes
};

/// What a picture has by an effect, against the same without it.
struct EffectCost {
    std::string name;
    double drawMs = 0, deviceMs = 0;
    std::int64_t bricks = 0;  ///< drawn for it alone
    std::int64_t passes = 0, textures = 0, deviceBytes = 0;
    std::int64_t changesPixels = 0;
    double changeRms = 0;  ///< of red, green and blue, of 255
};

/// What was drawn.
struct RenderedPicture {
    std::string field, platform, device;
    int width = 0, height = 0;
    ValueRange range;  ///< of the field's values
    std::size_t bricks = 0;
    std::int64_t poolBytes = 0;
    RenderCounts counts;
    std::vector<EffectCost> effects;  ///< when asked for
};

/// The scene of a request, with what the request has in its place. Throws InputError, also for a scene that
/// names a file outside its folder where the job doesn't follow links, and IoError.
Scene sceneOf(const RenderRequest& request, const Job& job);
/// A .vdb file, or a mesh whose bricks have come to rest. Throws as openVdbSource() and MeshSource do.
std::unique_ptr<PictureSource> openPictureSource(const std::string& input, const Scene& scene,
                                                 GlThread& thread, Job& job);
/// All but the counts.
void describe(const PictureSource& source, const GlThread& thread, const Scene& scene,
              RenderedPicture& picture);

/// Throws the error with the name of the file that it is about: the scene's, unless it names an input or
/// options are in the scene's place.
[[noreturn]] void throwNamed(const InputError& error, const RenderRequest& request,
                             std::span<const std::string> inputs);

/// A .png is drawn over the scene's background, with its legend; an .exr has light in place of a screen's
/// values, multiplied by the opacity A, without a background or legend. Throws InputError for a scene that
/// doesn't fit the file, or that shows nothing, GlError, IoError.
RenderedPicture renderScene(const RenderRequest& request, Job& job);
Json renderedJson(const RenderRequest& request, const RenderedPicture& picture);

}  // namespace tessera
