#pragma once

#include <string>

#include "job/picture_source.h"
#include "pictures/image.h"
#include "render/slice_renderer.h"
#include "scene/scene.h"
#include "tessera/execution.h"

namespace tessera {

/// A scene's picture of a source: how it is drawn, and what is put around it on a screen.
struct ScenePicture {
    RenderOptions options;
    std::array<double, 3> ground{};
    PictureMarks marks;
    LegendOptions legend;
    bool hasLegend = false;    ///< it is asked for, and there is room for it
    bool lacksLegend = false;  ///< it is asked for, and there isn't
};

/// What the legend of a scene's picture on a screen takes of its width; 0 without one.
int legendPixelsOf(const Scene& scene, const PictureSource& source, bool isOnScreen);

/// @param isOnScreen with its legend, beside which a camera that is to be found leaves the data.
/// Throws InputError for a scene that doesn't fit the source.
ScenePicture pictureOf(const Scene& scene, const PictureSource& source, bool isOnScreen);

/// Draws what is in the source's pool now. Throws as SliceRenderer::draw().
RgbaImage drawFrom(const PictureSource& source, SliceRenderer& renderer, const RenderOptions& options,
                   const Execution& execution, RenderCounts* counts = nullptr);
/// Nothing is to be seen.
bool isEmpty(const RgbaImage& drawn);

/// What was drawn by a picture's options, before its ground and with its legend.
RgbImage onScreen(const ScenePicture& picture, const RgbaImage& drawn);

/// Writes an .exr file: light in place of a screen's values, multiplied by the opacity A. Throws IoError.
void writeLight(const std::string& path, const RgbaImage& drawn, const Execution& execution);

}  // namespace tessera
