#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mesh/field_range.h"
#include "render/effect.h"
#include "render/effects/outline.h"
#include "tessera/focus.h"
#include "tessera/transfer_function.h"
#include "tessera/vec.h"

namespace tessera {

/// How values become colours: stops, or a named map over a range with opacities along it.
struct SceneFunction {
    std::string map = "viridis";
    std::optional<std::array<double, 2>> range;  ///< values at the ends; none: the field's
    bool isLogarithmic = false;                  ///< equal factors of the value take equal parts of the map
    /// Shares of the range from 0 to 1, ascending, with their opacities; none: by how rare values are.
    std::vector<std::array<double, 2>> opacities;
    std::vector<TransferFunction::Stop> stops;  ///< in place of all that
};

/// Where the picture is taken from. Without an eye all of the data is in the picture.
struct SceneCamera {
    std::optional<Vec3d> eyeWorld, targetWorld;
    Vec3d direction{-0.6, 0.75, -0.45};  ///< without an eye: where the camera looks
    Vec3d up{0, 0, 1};
    double openingDegrees = 35;
    /// With an eye: above 0, parallel rays and a picture so high.
    double heightWorld = 0;
    bool isParallel = false;  ///< without an eye
};

/// A place around which a mesh's bricks are fine.
struct SceneFocus {
    Vec3d placeWorld{0};
    std::optional<double> radiusWorld;  ///< Focus::radiusWorld; none: a sixteenth of the longest side
};

/// How a mesh becomes bricks; a file has its own.
struct SceneBricks {
    int resolution = 512;  ///< lattice points of the finest spacing along the longest side
    int cells = 16;        ///< along a brick's edge: 8, 16, 32 or 64
    std::int64_t budgetBytes = 1'000'000'000;  ///< of samples in memory
    /// None, and no view: around the middle.
    std::vector<SceneFocus> focus;
    /// Above 0: as fine as the picture shows, so many pixels a voxel; beside the places.
    double pixelsAVoxel = 0;
};

/// Effects that need more than the scene has: those of that name are made with the source of pictures.
inline constexpr const char* kOutline = "outline";

struct SceneOutline {
    std::string mesh;  ///< a file; empty: that of the source
    Outline shown;
};

/// What a picture shows. Every default is such that a scene without a word makes a picture.
struct Scene {
    std::string field;             ///< empty: the first
    std::optional<int> component;  ///< of a vector, counted from 0; none: its length
    SceneCamera camera;
    SceneFunction function;
    SceneBricks bricks;
    /// A layer as thick as this has the opacities of the function; none: a twentieth of the longest side.
    std::optional<double> layerWorld;
    std::array<double, 3> ground{1, 1, 1};  ///< red, green, blue from 0 to 1
    std::vector<HalfSpace> within;          ///< only what lies in all of these is shown
    int width = 1024, height = 768;         ///< pixels
    int samplesAPixel = 4;
    double slicesAVoxel = 2;
    bool hasLegend = true;
    std::string unit;             ///< of the values, for the legend
    std::string lengthUnit;       ///< of places, for axes and the scale bar
    std::vector<Effect> effects;  ///< in the order in which they are applied
    SceneOutline outline;         ///< for the effect of that name, which is still without lines
};

/// The camera of a scene. @param boundsWorld of what is to be in the picture. @param legendPixels that its
/// legend takes on the right: a camera without an eye leaves them free. Throws InputError for one that
/// sees nothing.
Camera cameraOf(const Scene& scene, const Box3d& boundsWorld, int legendPixels);

/// Where bricks are to be fine. @param camera cameraOf(scene). @param finestSpacingWorld of the bricks.
std::vector<Focus> focusOf(const SceneBricks& bricks, const Box3d& boundsWorld, const Camera& camera,
                           double finestSpacingWorld);

/// @param range of the field's values. @param histogram shares of the samples in bins of one width over it:
/// what the opacities come from where the scene has none. Throws InputError for a logarithmic scale over
/// values that aren't above 0.
TransferFunction functionOf(const SceneFunction& function, const ValueRange& range,
                            std::span<const double> histogram);
/// The values at the ends of the legend.
std::array<double, 2> shownRangeOf(const SceneFunction& function, const ValueRange& range);

}  // namespace tessera
