#include "scene/scene_file.h"

#include <algorithm>
#include <cmath>

#include "render/effects/axes.h"
#include "render/effects/bricks.h"
#include "render/effects/cuts.h"
#include "render/effects/errors.h"
#include "render/effects/isosurfaces.h"
#include "render/effects/occlusion.h"
#include "render/effects/preintegration.h"
#include "render/effects/probes.h"
#include "render/effects/scale_bar.h"
#include "render/effects/shading.h"
#include "render/effects/shadows.h"
#include "scene/colour_maps.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kVersion = 1;
constexpr int kMostPixels = 32768;
constexpr std::size_t kMostPlanes = 16;

std::array<double, 3> readColour(const JsonNode& json) {
    const std::vector<double> parts = json.numbers(3);
    std::array<double, 3> colour{};
    for (std::size_t c = 0; c < 3; ++c) {
        if (!(parts[c] >= 0 && parts[c] <= 1)) json.fail("three numbers from 0 to 1");
        colour[c] = parts[c];
    }
    return colour;
}

/// Refuses a key that another one rules out.
void refuseBoth(const JsonNode& json, const char* key, const char* other) {
    if (const auto found = json.find(key); found && json.find(other))
        found->refuse(std::string("can't stand beside ") + other);
}

Vec3d readDirection(const JsonNode& json) {
    const Vec3d direction = json.vector();
    const double length = glm::length(direction);
    if (!(length > 0) || !std::isfinite(length)) json.fail("a direction of a length above 0");
    return direction / length;
}

SceneCamera readCamera(const JsonNode& json) {
    json.expectKeys({"eye", "target", "direction", "up", "opening", "height", "parallel"});
    SceneCamera camera;
    for (const char* other : {"direction", "parallel"}) refuseBoth(json, other, "eye");
    refuseBoth(json, "opening", "height");
    refuseBoth(json, "opening", "parallel");
    for (const char* needs : {"target", "height"})
        if (const auto found = json.find(needs); found && !json.find("eye")) found->refuse("needs an eye");
    if (const auto eye = json.find("eye")) camera.eyeWorld = eye->vector();
    if (const auto target = json.find("target")) {
        camera.targetWorld = target->vector();
        if (*camera.targetWorld == *camera.eyeWorld) target->fail("another place than the eye");
    }
    if (const auto direction = json.find("direction")) camera.direction = readDirection(*direction);
    if (const auto up = json.find("up")) camera.up = readDirection(*up);
    if (const auto opening = json.find("opening")) camera.openingDegrees = opening->number(0.1, 170);
    if (const auto height = json.find("height")) camera.heightWorld = height->length();
    if (const auto parallel = json.find("parallel")) camera.isParallel = parallel->flag();
    return camera;
}

SceneBricks readBricks(const JsonNode& json) {
    json.expectKeys({"resolution", "cells", "budget", "focus", "view"});
    SceneBricks bricks;
    if (const auto resolution = json.find("resolution")) bricks.resolution = resolution->whole(2, 1 << 20);
    if (const auto cells = json.find("cells")) {
        bricks.cells = cells->whole(8, 64);
        if (bricks.cells & (bricks.cells - 1)) cells->fail("8, 16, 32 or 64");
    }
    if (const auto budget = json.find("budget")) bricks.budgetBytes = std::int64_t(budget->number(1, 1e15));
    if (const auto focus = json.find("focus"))
        for (const JsonNode& at : focus->list("a list of places")) {
            at.expectKeys({"place", "radius"});
            SceneFocus& one = bricks.focus.emplace_back();
            one.placeWorld = at.at("place").vector();
            if (const auto radius = at.find("radius")) one.radiusWorld = radius->length();
        }
    if (const auto view = json.find("view")) bricks.pixelsAVoxel = view->number(0.25, 1000);
    return bricks;
}

SceneFunction readFunction(const JsonNode& json) {
    json.expectKeys({"map", "range", "log", "opacity", "stops"});
    SceneFunction function;
    for (const char* other : {"map", "range", "log", "opacity"}) refuseBoth(json, other, "stops");
    if (const auto stops = json.find("stops")) function.stops = readStops(*stops);
    if (const auto map = json.find("map")) {
        function.map = map->text();
        std::string names;
        for (const std::string_view name : colourMapNames())
            names += (names.empty() ? "" : ", ") + std::string(name);
        if (!isColourMap(function.map)) map->fail("one of " + names);
    }
    if (const auto range = json.find("range")) {
        const std::vector<double> ends = range->numbers(2);
        if (!(ends[0] < ends[1]) || !std::isfinite(ends[1] - ends[0]))
            range->fail("two numbers, the smaller one first");
        function.range = {ends[0], ends[1]};
    }
    if (const auto log = json.find("log")) function.isLogarithmic = log->flag();
    if (const auto opacity = json.find("opacity")) {
        const std::string expected = "a list of [share of the range, opacity], each from 0 to 1, ascending";
        for (const JsonNode& pair : opacity->list(expected)) {
            const std::vector<double> at = pair.numbers(2);
            if (!(at[0] >= 0 && at[0] <= 1 && at[1] >= 0 && at[1] <= 1) ||
                (!function.opacities.empty() && at[0] < function.opacities.back()[0]))
                opacity->fail(expected);
            function.opacities.push_back({at[0], at[1]});
        }
        if (function.opacities.empty()) opacity->fail(expected);
    }
    return function;
}

Box3d readBox(const JsonNode& json) {
    const std::vector<double> b = json.numbers(6);
    for (std::size_t a = 0; a < 3; ++a)
        if (!(b[a] < b[a + 3])) json.fail("x0, y0, z0, x1, y1, z1, each first one below the second");
    return {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}};
}

/// The keys "normal" and "offset" of a plane.
HalfSpace readHalfSpace(const JsonNode& json) {
    const Vec3d direction = readDirection(json.at("normal"));
    const double offset = json.at("offset").number() / glm::length(json.at("normal").vector());
    if (!std::isfinite(offset)) json.at("offset").fail("a number that isn't so large beside the normal");
    return {direction, offset};
}

void readClip(const JsonNode& json, std::vector<HalfSpace>& within) {
    json.expectKeys({"box", "planes"});
    if (const auto box = json.find("box")) {
        const Box3d bounds = readBox(*box);
        for (int a = 0; a < 3; ++a) {
            Vec3d axis(0);
            axis[a] = 1;
            within.push_back({axis, bounds.min[a]});
            within.push_back({-axis, -bounds.max[a]});
        }
    }
    if (const auto planes = json.find("planes")) {
        const auto list = planes->list("a list of planes");
        if (list.size() > kMostPlanes) planes->fail("at most 16 planes");
        for (const JsonNode& plane : list) {
            plane.expectKeys({"normal", "offset"});
            within.push_back(readHalfSpace(plane));
        }
    }
}

double readShare(const JsonNode& json, const char* key, double otherwise) {
    const auto found = json.find(key);
    return found ? found->number(0, 1) : otherwise;
}

double readWidth(const JsonNode& json, double otherwise) {
    const auto width = json.find("width");
    return width ? width->number(0.1, 100) : otherwise;
}

Effect readShading(const JsonNode& json) {
    json.expectKeys({"light", "ambient", "diffuse", "specular", "shininess"});
    Shading shading;
    if (const auto light = json.find("light")) shading.towardsLight = readDirection(*light);
    shading.ambient = readShare(json, "ambient", shading.ambient);
    shading.diffuse = readShare(json, "diffuse", shading.diffuse);
    shading.specular = readShare(json, "specular", shading.specular);
    if (const auto shininess = json.find("shininess")) shading.shininess = shininess->number(1, 1000);
    return shadingEffect(shading);
}

Effect readIsosurfaces(const JsonNode& json) {
    json.expectKeys({"surfaces", "light"});
    std::vector<Isosurface> surfaces;
    const std::string expected = "a list of 1 to 16 surfaces";
    for (const JsonNode& node : json.at("surfaces").list(expected)) {
        node.expectKeys({"value", "color", "opacity"});
        Isosurface surface;
        surface.value = node.at("value").number();
        if (const auto color = node.find("color")) surface.color = readColour(*color);
        surface.opacity = readShare(node, "opacity", surface.opacity);
        surfaces.push_back(surface);
    }
    if (surfaces.empty() || surfaces.size() > 16) json.at("surfaces").fail(expected);
    const auto light = json.find("light");
    return isosurfacesEffect(std::move(surfaces), light ? readDirection(*light) : Vec3d(0));
}

Effect readBrickEdges(const JsonNode& json) {
    json.expectKeys({"width", "opacity"});
    BrickEdges edges;
    edges.widthPixels = readWidth(json, edges.widthPixels);
    edges.opacity = readShare(json, "opacity", edges.opacity);
    return brickEdgesEffect(edges);
}

Contours readContours(const JsonNode& json) {
    json.expectKeys({"values", "count", "width", "color"});
    refuseBoth(json, "count", "values");
    Contours contours;
    if (const auto values = json.find("values")) {
        const std::string expected = "a list of 1 to 64 values";
        for (const JsonNode& value : values->list(expected)) contours.values.push_back(value.number());
        if (contours.values.empty() || contours.values.size() > 64) values->fail(expected);
    }
    if (const auto count = json.find("count")) contours.count = count->whole(1, 64);
    if (const auto width = json.find("width")) contours.widthPixels = width->number(0.1, 100);
    if (const auto color = json.find("color")) contours.color = readColour(*color);
    return contours;
}

Effect readCuts(const JsonNode& json) {
    json.expectKeys({"planes", "contours"});
    Cuts cuts;
    const std::string expected = "a list of 1 to 16 planes";
    for (const JsonNode& node : json.at("planes").list(expected)) {
        node.expectKeys({"normal", "offset", "opacity"});
        cuts.planes.push_back({readHalfSpace(node), readShare(node, "opacity", 1)});
    }
    if (cuts.planes.empty() || cuts.planes.size() > 16) json.at("planes").fail(expected);
    if (const auto contours = json.find("contours")) cuts.contours = readContours(*contours);
    return cutsEffect(cuts);
}

std::vector<ProbeShape> readShapes(const JsonNode& json);

ProbeShape readShape(const JsonNode& json) {
    constexpr std::pair<const char*, ProbeShape::Kind> kKinds[] = {{"plane", ProbeShape::plane},
                                                                   {"sphere", ProbeShape::ball},
                                                                   {"box", ProbeShape::box},
                                                                   {"union", ProbeShape::unite},
                                                                   {"intersection", ProbeShape::common},
                                                                   {"difference", ProbeShape::subtract}};
    json.expectKeys({"plane", "sphere", "box", "union", "intersection", "difference"});
    std::optional<ProbeShape> shape;
    for (const auto& [key, kind] : kKinds) {
        const auto node = json.find(key);
        if (!node) continue;
        if (shape) node->refuse("can't stand beside another shape");
        shape.emplace().kind = kind;
        switch (kind) {
            case ProbeShape::plane:
                node->expectKeys({"normal", "offset"});
                shape->half = readHalfSpace(*node);
                break;
            case ProbeShape::ball:
                node->expectKeys({"center", "radius"});
                shape->centerWorld = node->at("center").vector();
                shape->radiusWorld = node->at("radius").length();
                break;
            case ProbeShape::box:
                shape->boxWorld = readBox(*node);
                break;
            default:
                shape->parts = readShapes(*node);
        }
    }
    if (!shape) json.fail("a plane, sphere, box, union, intersection or difference");
    return *shape;
}

std::vector<ProbeShape> readShapes(const JsonNode& json) {
    std::vector<ProbeShape> shapes;
    for (const JsonNode& node : json.list("a list of shapes")) shapes.push_back(readShape(node));
    if (shapes.empty()) json.fail("a list of shapes");
    return shapes;
}

Effect readProbes(const JsonNode& json) {
    json.expectKeys({"shapes", "keep", "opacity", "lit", "light"});
    Probes probes;
    probes.shape.kind = ProbeShape::unite;
    probes.shape.parts = readShapes(json.at("shapes"));
    if (const auto keep = json.find("keep")) {
        const std::string side = keep->text();
        if (side != "inside" && side != "outside") keep->fail("inside or outside");
        probes.keepsInside = side == "inside";
    }
    probes.opacity = readShare(json, "opacity", probes.opacity);
    if (const auto lit = json.find("lit")) probes.isLit = lit->flag();
    if (const auto light = json.find("light")) {
        if (!probes.isLit) light->refuse("needs lit to be true");
        probes.towardsLight = readDirection(*light);
    }
    try {
        return probesEffect(probes);
    } catch (const InputError& error) {
        json.at("shapes").refuse(error.what());
    }
}

Effect readOcclusion(const JsonNode& json) {
    json.expectKeys({"radius", "voxels", "strength"});
    refuseBoth(json, "voxels", "radius");
    Occlusion occlusion;
    if (const auto radius = json.find("radius")) occlusion.radiusWorld = radius->length();
    if (const auto voxels = json.find("voxels")) occlusion.radiusVoxels = voxels->number(0.5, 64);
    occlusion.strength = readShare(json, "strength", occlusion.strength);
    return occlusionEffect(occlusion);
}

Effect readShadows(const JsonNode& json) {
    json.expectKeys({"light", "strength", "resolution"});
    Shadows shadows;
    shadows.towardsLight = readDirection(json.at("light"));
    shadows.strength = readShare(json, "strength", shadows.strength);
    if (const auto resolution = json.find("resolution")) shadows.resolution = resolution->whole(8, 512);
    return shadowsEffect(shadows);
}

Effect readPreintegration(const JsonNode& json) {
    json.expectKeys({});
    return preintegrationEffect();
}

/// Of lines and words that stand out from the ground.
std::array<double, 3> inkOn(const std::array<double, 3>& ground) {
    const double light = 0.3 * ground[0] + 0.6 * ground[1] + 0.1 * ground[2];
    return light > 0.5 ? std::array{0.25, 0.25, 0.25} : std::array{0.8, 0.8, 0.8};
}

Effect readAxes(const JsonNode& json, const Scene& scene) {
    json.expectKeys({"color", "width"});
    Axes axes;
    axes.widthPixels = readWidth(json, axes.widthPixels);
    const auto color = json.find("color");
    axes.color = color ? readColour(*color) : inkOn(scene.ground);
    axes.unit = scene.lengthUnit;
    return axesEffect(axes);
}

Effect readScaleBar(const JsonNode& json, const Scene& scene) {
    json.expectKeys({"color"});
    const auto color = json.find("color");
    return scaleBarEffect({color ? readColour(*color) : inkOn(scene.ground), scene.lengthUnit});
}

Effect readErrors(const JsonNode& json, const Scene& scene) {
    json.expectKeys({"bound", "strength"});
    ErrorTint tint;
    if (const auto bound = json.find("bound")) tint.bound = bound->length();
    tint.strength = readShare(json, "strength", tint.strength);
    tint.wordsColor = inkOn(scene.ground);
    return errorsEffect(tint);
}

SceneOutline readOutline(const JsonNode& json, const Scene& scene) {
    json.expectKeys({"mesh", "angle", "edges", "width", "color"});
    SceneOutline outline;
    if (const auto mesh = json.find("mesh")) outline.mesh = mesh->filePath();
    if (const auto edges = json.find("edges")) {
        const std::string which = edges->text();
        if (which != "sharp" && which != "all") edges->fail("sharp or all");
        if (which == "all") outline.shown.leastDegrees = 0;
    }
    if (const auto angle = json.find("angle")) {
        if (outline.shown.leastDegrees == 0) angle->refuse("can't stand beside all edges");
        outline.shown.leastDegrees = angle->number(1, 180);
    }
    outline.shown.widthPixels = readWidth(json, outline.shown.widthPixels);
    const auto color = json.find("color");
    outline.shown.color = color ? readColour(*color) : inkOn(scene.ground);
    return outline;
}

/// @param scene what is read already.
std::vector<Effect> readEffects(const JsonNode& json, Scene& scene) {
    json.expectKeys({"axes", "bricks", "cuts", "errors", "isosurfaces", "occlusion", "outline",
                     "preintegration", "probes", "scale_bar", "shading", "shadows"});
    std::vector<Effect> effects;
    if (const auto axes = json.find("axes")) effects.push_back(readAxes(*axes, scene));
    if (const auto bricks = json.find("bricks")) effects.push_back(readBrickEdges(*bricks));
    if (const auto cuts = json.find("cuts")) effects.push_back(readCuts(*cuts));
    if (const auto errors = json.find("errors")) effects.push_back(readErrors(*errors, scene));
    if (const auto surfaces = json.find("isosurfaces")) effects.push_back(readIsosurfaces(*surfaces));
    if (const auto outline = json.find("outline")) {
        scene.outline = readOutline(*outline, scene);
        effects.emplace_back().name = kOutline;
    }
    if (const auto preintegration = json.find("preintegration"))
        effects.push_back(readPreintegration(*preintegration));
    if (const auto probes = json.find("probes")) effects.push_back(readProbes(*probes));
    if (const auto bar = json.find("scale_bar")) effects.push_back(readScaleBar(*bar, scene));
    if (const auto shading = json.find("shading")) effects.push_back(readShading(*shading));
    if (const auto occlusion = json.find("occlusion")) effects.push_back(readOcclusion(*occlusion));
    if (const auto shadows = json.find("shadows")) effects.push_back(readShadows(*shadows));
    return effects;
}

}  // namespace

std::vector<TransferFunction::Stop> readStops(const JsonNode& json) {
    TransferFunction function;
    for (const JsonNode& node : json.list("a list of stops")) {
        node.expectKeys({"value", "color", "opacity"});
        TransferFunction::Stop stop;
        stop.value = node.at("value").number();
        stop.opacity = node.at("opacity").number();
        if (const auto color = node.find("color")) {
            const std::vector<double> parts = color->numbers(3);
            std::copy(parts.begin(), parts.end(), stop.color.begin());
        }
        function.stops.push_back(stop);
    }
    try {
        checkTransferFunction(function);
    } catch (const InputError& error) {
        json.refuse(error.what());
    }
    return function.stops;
}

Scene readScene(const std::string& path) {
    return sceneFrom(JsonNode::read(path, "the scene"));
}

Scene sceneFrom(const JsonNode& json) {
    json.expectKeys({"$schema", "version", "field", "component", "camera", "transfer_function", "layer",
                     "background", "bricks", "clip", "size", "samples", "slices", "legend", "unit",
                     "length_unit", "effects", "bookmarks"});
    if (json.at("version").number() != kVersion) json.at("version").fail("1, the version of this format");
    Scene scene;
    if (const auto field = json.find("field")) scene.field = field->text();
    if (const auto component = json.find("component")) scene.component = component->whole(0, 8);
    if (const auto camera = json.find("camera")) scene.camera = readCamera(*camera);
    if (const auto function = json.find("transfer_function")) scene.function = readFunction(*function);
    if (const auto layer = json.find("layer")) scene.layerWorld = layer->length();
    if (const auto background = json.find("background")) scene.ground = readColour(*background);
    if (const auto bricks = json.find("bricks")) scene.bricks = readBricks(*bricks);
    if (const auto clip = json.find("clip")) readClip(*clip, scene.within);
    if (const auto size = json.find("size")) {
        const auto edges = size->list("width and height in pixels");
        if (edges.size() != 2) size->fail("width and height in pixels");
        scene.width = edges[0].whole(1, kMostPixels);
        scene.height = edges[1].whole(1, kMostPixels);
    }
    if (const auto samples = json.find("samples")) {
        scene.samplesAPixel = samples->whole(1, 16);
        const int side = int(std::lround(std::sqrt(scene.samplesAPixel)));
        if (side * side != scene.samplesAPixel) samples->fail("1, 4, 9 or 16");
    }
    if (const auto slices = json.find("slices")) scene.slicesAVoxel = slices->number(0.125, 64);
    if (const auto legend = json.find("legend")) scene.hasLegend = legend->flag();
    // A viewer's; pictures don't look at them.
    if (const auto bookmarks = json.find("bookmarks"))
        for (const JsonNode& bookmark : bookmarks->list("a list of views")) {
            bookmark.expectKeys({"name", "camera"});
            bookmark.at("name").text();
            readCamera(bookmark.at("camera"));
        }
    if (const auto unit = json.find("unit")) scene.unit = unit->text();
    if (const auto unit = json.find("length_unit")) scene.lengthUnit = unit->text();
    if (const auto effects = json.find("effects")) scene.effects = readEffects(*effects, scene);
    return scene;
}

}  // namespace tessera
