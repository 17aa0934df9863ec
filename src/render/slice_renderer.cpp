#include "render/slice_renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "base/timer.h"
#include "gl/gl_program.h"
#include "refine/camera_view.h"
#include "refine/wishes.h"
#include "render/effect_hooks.h"
#include "render/effect_pass.h"
#include "render/line_pass.h"
#include "render/shaders.h"
#include "render/visibility_order.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Boxes are drawn larger by that share of a ray's width: some hundred times what a rasterizer rounds.
constexpr double kBesidesRays = 0.3;
/// Rays along an edge of what is drawn at once.
constexpr int kTile = 1024, kLeastTile = 64;
constexpr std::size_t kMostClips = 32;
/// Pixels are closed after so many parts of the bricks.
constexpr std::size_t kParts = 12;
constexpr std::size_t kFewBricks = 64;
/// Texture units from here on are those of effects; a pool's and the lines' come before.
constexpr GLuint kEffectUnits = 5;
/// In sizes of the data.
constexpr double kFarthest = 1e6;

/// As the shaders have them.
struct DeviceBrick {
    std::array<float, 3> low;
    float spacing;
    std::array<float, 3> high;
    float besides;
    std::array<std::int32_t, 3> texel;
    std::int32_t isWhole;
    std::array<std::int32_t, 3> index;
    std::int32_t depth;
    float firstSlab;
    float effectNumber;
    std::array<float, 2> padding;
};
struct DeviceStop {
    std::array<float, 4> shown;
    float code;
    float depth;  // see effects/depth.glsl
    std::array<float, 2> padding;
};

/// Bricks of one atlas that follow each other.
struct Run {
    int atlas = 0;
    std::size_t first = 0, count = 0;
};

std::array<float, 3> floats(const Vec3d& v) {
    return {float(v.x), float(v.y), float(v.z)};
}

/// The mean of -ln(1 - a) for opacities a from one to another, as effects/depth.glsl has it; a lot, but not
/// without end, where both are 1.
double meanDepth(double one, double other) {
    const double u = 1 - one, v = 1 - other;
    constexpr double kMost = 100;
    if (std::abs(u - v) < 1e-6) return std::min(-std::log(0.5 * (u + v)), kMost);
    const auto integral = [](double x) { return x > 0 ? x - x * std::log(x) : 0; };
    return (integral(u) - integral(v)) / (u - v);
}

/// What the picture's camera looks like from the bricks.
class Scene {
  public:
    Scene(const BrickPool& pool, const BrickFrame& frame, std::span<const PlacedBrick> bricks,
          const RenderOptions& options)
        : pool_(pool),
          frame_(frame),
          options_(options),
          view_(viewOf(options.camera)),
          eye_(options.camera.eyeWorld),
          range_(options.values) {
        needsAll_ = std::any_of(options.effects.begin(), options.effects.end(),
                                [](const Effect& effect) { return effect.needsAllBricks; });
        for (const PlacedBrick& brick : bricks) {
            const Box3d box = frame.boxWorld(brick.key);
            box_.include(box.min);
            box_.include(box.max);
            finestSpacing_ = std::min(finestSpacing_, frame.spacingWorld(brick.key.depth));
            if (brick.range.empty() || !options.values.empty()) continue;
            range_.min = std::min(range_.min, brick.range.min);
            range_.max = std::max(range_.max, brick.range.max);
        }
        if (!bricks.empty()) placeEye();
        for (const HalfSpace& half : options.within)
            seen_.push_back({half.normalWorld, half.offsetWorld - glm::dot(half.normalWorld, eye_)});
        const double wide = view_.wide, high = view_.high;
        seen_.push_back({view_.forward, 0});
        for (const double sign : {-1.0, 1.0}) {
            if (view_.isParallel) {
                seen_.push_back({sign * view_.right, -wide});
                seen_.push_back({sign * view_.up, -high});
            } else {
                seen_.push_back({wide * view_.forward + sign * view_.right, 0});
                seen_.push_back({high * view_.forward + sign * view_.up, 0});
            }
        }
    }

    const CameraView& view() const { return view_; }
    /// Where places count from.
    const Vec3d& eye() const { return eye_; }
    double raySize() const { return pixelSize() / std::sqrt(options_.samplesAPixel); }

    bool isSeen(const PlacedBrick& brick) const {
        if (!brick.isCovered || brick.range.empty()) return false;
        // Rounded codes may lie a step beyond the range.
        const double beyond = brick.range.width() / 64 + 1e-6 * std::abs(brick.range.max);
        if (!needsAll_ && !showsAny(options_.function, brick.range.min - beyond, brick.range.max + beyond))
            return false;
        const Box3d box = fromEye(brick);
        return std::none_of(seen_.begin(), seen_.end(),
                            [&](const HalfSpace& half) { return isOutside(box, half); });
    }

    /// The bricks that are seen, the nearest first.
    std::vector<const PlacedBrick*> inOrder(std::span<const PlacedBrick> bricks) const {
        std::vector<const PlacedBrick*> seen;
        std::vector<DepthKey> keys;
        for (const PlacedBrick& brick : bricks)
            if (isSeen(brick)) seen.push_back(&brick), keys.push_back(brick.key);
        const double edge = frame_.rootSpacingWorld * frame_.cells;
        const Viewpoint from{(eye_ - frame_.originWorld) / edge, view_.isParallel ? view_.forward : Vec3d(0)};
        std::vector<const PlacedBrick*> ordered;
        for (const std::size_t i : visibilityOrder(keys, from)) ordered.push_back(seen[i]);
        return ordered;
    }

    DeviceBrick placed(const PlacedBrick& brick) const {
        const Box3d box = fromEye(brick);
        const Vec3i texel = pool_.layout().firstTexel(brick.slot);
        const double spacing = frame_.spacingWorld(brick.key.depth);
        const double slab = spacing / options_.slicesAVoxel;
        DeviceBrick placed{};
        placed.low = floats(box.min);
        placed.high = floats(box.max);
        placed.spacing = float(spacing);
        double farthest = 1;  // parallel rays are as far apart everywhere
        if (!view_.isParallel) farthest = glm::length(glm::max(glm::abs(box.min), glm::abs(box.max)));
        placed.besides = float(kBesidesRays * raySize() * farthest + 1e-6 * glm::length(box.min));
        placed.texel = {texel.x, texel.y, texel.z};
        placed.isWhole = brick.isWhole;
        placed.index = {brick.key.index.x, brick.key.index.y, brick.key.index.z};
        placed.depth = brick.key.depth.halvings();
        placed.firstSlab = float(std::floor(std::max(nearestDepth(box), 0.0) / slab));
        return placed;
    }

    std::vector<DeviceStop> stops() const {
        const ValueCoding& coding = pool_.coding().codings()[std::size_t(options_.channel)];
        std::vector<DeviceStop> stops;
        // Far from all values codes would overflow: there the function at the ends of what there is counts.
        const double width = std::max(range_.width(), 1e-6 * std::abs(range_.max));
        const double low = range_.min - width, high = range_.max + width;
        const auto add = [&](const TransferFunction::Stop& stop, double value) {
            stops.push_back(
                {{float(stop.color[0]), float(stop.color[1]), float(stop.color[2]), float(stop.opacity)},
                 float(coding.encode(value)),
                 0,
                 {}});
        };
        const auto& all = options_.function.stops;
        for (std::size_t i = 0; i < all.size(); ++i) {
            const double value = all[i].value;
            const bool isBelow = value<low, isAbove = value> high;
            if (isBelow) {
                if (i + 1 == all.size())
                    add(all[i], low);
                else if (all[i + 1].value >= low)
                    add(between(all[i], all[i + 1], low), low);
            } else if (isAbove) {
                add(i == 0 ? all[0] : between(all[i - 1], all[i], high), high);
                break;
            } else {
                add(all[i], value);
            }
        }
        double depth = 0;
        for (std::size_t i = 1; i < stops.size(); ++i) {
            depth += double(stops[i].code - stops[i - 1].code) *
                     meanDepth(double(stops[i - 1].shown[3]), double(stops[i].shown[3]));
            stops[i].depth = float(depth);
        }
        return stops;
    }

    EffectScene forEffects(const GlFunctions& gl, const GlProgram& program) const {
        return {gl,
                program,
                pool_.coding().codings()[std::size_t(options_.channel)],
                range_,
                box_,
                frame_,
                finestSpacing_,
                options_.layerWorld,
                pixelSize(),
                options_.lineScale,
                eye_,
                options_.function,
                largestOf(options_.brickNumbers)};
    }

  private:
    Box3d fromEye(const PlacedBrick& brick) const {
        const Box3d box = frame_.boxWorld(brick.key);
        return {box.min - eye_, box.max - eye_};
    }
    /// Of a box relative to the eye; world units.
    double nearestDepth(const Box3d& box) const {
        double nearest = 0;
        for (int a = 0; a < 3; ++a)
            nearest += std::min(view_.forward[a] * box.min[a], view_.forward[a] * box.max[a]);
        return nearest;
    }
    double pixelSize() const { return 2 * view_.high / options_.camera.heightPixels; }
    /// Of the floats that the shaders count with nothing may be lost.
    void placeEye() {
        const double nearest = nearestDepth({box_.min - eye_, box_.max - eye_});
        const double coarsest = frame_.rootSpacingWorld / options_.slicesAVoxel;
        // Parallel rays may begin anywhere, but slabs are counted from the eye.
        if (view_.isParallel && nearest > 0)
            eye_ += std::floor(nearest / coarsest) * coarsest * view_.forward;
        const Vec3d size = box_.size(), far = glm::max(glm::abs(box_.min - eye_), glm::abs(box_.max - eye_));
        if (!(glm::length(far) <= kFarthest * glm::length(size)))
            throw InputError("the camera is farther away than a million times the size of the data");
    }

    const BrickPool& pool_;
    const BrickFrame& frame_;
    const RenderOptions& options_;
    CameraView view_;
    Vec3d eye_;
    std::vector<HalfSpace> seen_;  // relative to the eye
    bool needsAll_ = false;
    Box3d box_;  // of all bricks
    double finestSpacing_ = std::numeric_limits<double>::infinity();
    ValueRange range_;  // likewise
};

void checkOptions(const BrickPool& pool, const RenderOptions& options) {
    checkTransferFunction(options.function);
    if (options.channel < 0 || options.channel >= pool.coding().channels())
        throw InputError("the pool has no channel " + std::to_string(options.channel));
    const auto isLength = [](double v) { return v > 0 && std::isfinite(v); };
    if (!isLength(options.layerWorld) || !isLength(options.slicesAVoxel) || options.slicesAVoxel > 64)
        throw InputError("slices need a layer of a length above 0, and between 0 and 64 of them a voxel");
    const int rays = options.samplesAPixel;
    if (rays != 1 && rays != 4 && rays != 9 && rays != 16)
        throw InputError("a pixel has 1, 4, 9 or 16 rays, not " + std::to_string(rays));
    if (options.within.size() > kMostClips) throw InputError("a picture has 32 clip planes at most");
    if (std::ranges::count_if(options.effects, [](const Effect& one) { return !one.classify.empty(); }) > 1)
        throw InputError("one effect at most says what a slab looks like");
    for (const HalfSpace& half : options.within)
        if (const double length = glm::length(half.normalWorld);
            !isLength(length) || !std::isfinite(half.offsetWorld))
            throw InputError("a clip plane needs a normal of a finite length above 0");
}

}  // namespace

void EffectScene::set(const char* name, int value) const {
    gl.ProgramUniform1i(program.id(), program.uniform(name), value);
}

double largestOf(std::span<const float> brickNumbers) {
    double largest = 0;
    for (const float number : brickNumbers)
        if (std::isfinite(number)) largest = std::max(largest, double(number));
    return largest;
}

void EffectScene::set(const char* name, double value) const {
    gl.ProgramUniform1f(program.id(), program.uniform(name), float(value));
}

void EffectScene::set(const char* name, const Vec3d& value) const {
    gl.ProgramUniform3f(program.id(), program.uniform(name), float(value.x), float(value.y), float(value.z));
}

void EffectScene::set(const char* name, std::span<const GLint> values) const {
    gl.ProgramUniform1iv(program.id(), program.uniform(name), GLsizei(values.size()), values.data());
}

void EffectScene::set(const char* name, std::span<const float> values) const {
    gl.ProgramUniform1fv(program.id(), program.uniform(name), GLsizei(values.size()), values.data());
}

void EffectScene::set(const char* name, std::span<const std::array<float, 4>> values) const {
    gl.ProgramUniform4fv(program.id(), program.uniform(name), GLsizei(values.size()), values[0].data());
}

std::array<float, 4> EffectScene::planeFromEye(const HalfSpace& half) const {
    const double length = glm::length(half.normalWorld);
    const std::array<float, 3> n = floats(half.normalWorld / length);
    return {n[0], n[1], n[2], float((half.offsetWorld - glm::dot(half.normalWorld, eyeWorld)) / length)};
}

void EffectScene::setDirection(const char* name, const Vec3d& value) const {
    const double length = glm::length(value);
    set(name, length > 0 ? value / length : Vec3d(0));
}

PictureLines linesOf(std::span<const Effect> effects, const LineView& view) {
    PictureLines all;
    for (const Effect& effect : effects) {
        if (!effect.lines) continue;
        PictureLines lines = effect.lines(view);
        all.segments.insert(all.segments.end(), lines.segments.begin(), lines.segments.end());
        all.marks.dotPixels = std::max(all.marks.dotPixels, lines.marks.dotPixels);
        all.marks.boxes.insert(all.marks.boxes.end(), lines.marks.boxes.begin(), lines.marks.boxes.end());
        all.marks.words.insert(all.marks.words.end(), lines.marks.words.begin(), lines.marks.words.end());
    }
    return all;
}

// All that OpenGL has; only its thread looks at it.
struct SliceRenderer::Device {
    std::map<std::string, GlProgram> programs;      // by cells and effects
    std::map<std::string, GlProgram> passPrograms;  // of effects
    const GlProgram* bricks = nullptr;              // of the picture
    std::optional<GlProgram> close;
    GlVertexArray vertices;
    GlTexture color, depth;
    GlFramebuffer target, closing;
    std::optional<LinePass> lines;  // made for the first picture that has some

    void prepare(GlContext& context, int brickCells, std::span<const Effect> effects, bool hasLines);
    void makeTargets(GlContext& context);
    const GlProgram& programOf(GlContext& context, int brickCells, std::span<const Effect> effects,
                               bool hasLines);
    void setUniforms(const GlFunctions& gl, const Scene& scene, const BrickPool& pool,
                     const RenderOptions& options) const;
    void bindTextures(const GlFunctions& gl, std::span<const EffectTexture> textures) const;
    void draw(GlContext& context, const BrickPool& pool, std::span<const Run> runs, std::size_t brickCount,
              const PictureTile& tile, const Vec3i& picture, std::size_t group, bool hasLines,
              RenderCounts& counts) const;
};

const GlProgram& SliceRenderer::Device::programOf(GlContext& context, int brickCells,
                                                  std::span<const Effect> effects, bool hasLines) {
    std::string key = std::to_string(brickCells) + (hasLines ? " with lines" : "");
    for (const Effect& effect : effects)
        if (!effect.texts.empty()) key += " " + effect.name;
    if (const auto found = programs.find(key); found != programs.end()) return found->second;
    namespace text = shaders::render;
    std::vector<ShaderDefine> defines{{"CELLS", std::to_string(brickCells)}};
    const HookTexts hooks = hookTextsOf(effects);
    defines.insert(defines.end(), hooks.defines.begin(), hooks.defines.end());
    if (hasLines) defines.push_back({"LINES"});
    std::vector<ShaderText> shared{text::kView, text::kBrick, text::kStops, text::kSamples, text::kClips};
    if (std::ranges::any_of(effects, &Effect::readsIndex)) {
        defines.push_back({"BRICK_INDEX_BINDING", "2"});
        shared.push_back(brickIndexShader());
    }
    shared.push_back(text::kBrickSample);
    if (!hooks.heads.empty()) shared.push_back({"names of effects", hooks.heads});
    for (const Effect& effect : effects)
        for (const ShaderText& one : effect.texts)
            if (std::ranges::find(shared, one.name, &ShaderText::name) == shared.end()) shared.push_back(one);
    if (!hooks.functions.empty()) shared.push_back({"calls of effects", hooks.functions});
    GlProgram made = makeProgram(context,
                                 {{GL_VERTEX_SHADER, text::kBrickVertex, {text::kView, text::kBrick}},
                                  {GL_FRAGMENT_SHADER, text::kBrickFragment, shared}},
                                 defines);
    return programs.emplace(key, std::move(made)).first->second;
}

void SliceRenderer::Device::prepare(GlContext& context, int brickCells, std::span<const Effect> effects,
                                    bool hasLines) {
    namespace text = shaders::render;
    bricks = &programOf(context, brickCells, effects, hasLines);
    if (!close)
        close = makeProgram(
            context, {{GL_VERTEX_SHADER, text::kCloseVertex}, {GL_FRAGMENT_SHADER, text::kCloseFragment}});
    if (!color) makeTargets(context);
    if (hasLines && !lines) lines.emplace(context, kTile, color, depth);
}

void SliceRenderer::Device::makeTargets(GlContext& context) {
    Device made;
    made.vertices = GlVertexArray(context);
    made.color = GlTexture(context, GL_TEXTURE_2D, GL_RGBA32F, kTile, kTile);
    made.depth = GlTexture(context, GL_TEXTURE_2D, GL_DEPTH_COMPONENT32F, kTile, kTile);
    made.target = GlFramebuffer(context);
    made.target.attach(GL_COLOR_ATTACHMENT0, made.color);
    made.target.attach(GL_DEPTH_ATTACHMENT, made.depth);
    made.target.throwIfIncomplete();
    // Without the picture, which is read there.
    made.closing = GlFramebuffer(context);
    made.closing.attach(GL_DEPTH_ATTACHMENT, made.depth);
    const GLenum none = GL_NONE;
    context.functions().NamedFramebufferDrawBuffers(made.closing.id(), 1, &none);
    made.closing.throwIfIncomplete();
    vertices = std::move(made.vertices);
    color = std::move(made.color), depth = std::move(made.depth);
    target = std::move(made.target), closing = std::move(made.closing);
}

void SliceRenderer::Device::setUniforms(const GlFunctions& gl, const Scene& scene, const BrickPool& pool,
                                        const RenderOptions& options) const {
    const EffectScene known = scene.forEffects(gl, *bricks);
    const CameraView& view = scene.view();
    known.set("forward", view.forward);
    known.set("right", view.wide * view.right);
    known.set("up", view.high * view.up);
    known.set("isParallel", int(view.isParallel));
    setPoolUniforms(known, pool, options.within, options.channel);
    known.set("slicesAVoxel", options.slicesAVoxel);
    known.set("layersAWorldUnit", 1 / options.layerWorld);
    for (const Effect& effect : options.effects)
        if (effect.setUniforms) effect.setUniforms(known);
}

void SliceRenderer::Device::bindTextures(const GlFunctions& gl,
                                         std::span<const EffectTexture> textures) const {
    GLuint unit = kEffectUnits;
    for (const EffectTexture& texture : textures) {
        gl.ProgramUniform1i(bricks->id(), bricks->uniform(texture.sampler), GLint(unit));
        gl.BindTextureUnit(unit++, texture.texture.id());
    }
}

void SliceRenderer::Device::draw(GlContext& context, const BrickPool& pool, std::span<const Run> runs,
                                 std::size_t brickCount, const PictureTile& tile, const Vec3i& picture,
                                 std::size_t group, bool hasLines, RenderCounts& counts) const {
    const GlFunctions& gl = context.functions();
    const GLuint program = bricks->id();
    // Of a picture from -1 to 1, right and up.
    const double wide = picture.x, high = picture.y;
    const double left = tile.x, below = high - tile.y - tile.height;
    gl.ProgramUniform4fv(program, bricks->uniform("pictureFromPixel"), 1,
                         pictureFromPixel(tile, picture).data());
    gl.ProgramUniform4f(program, bricks->uniform("tileFromPicture"), float(wide / tile.width),
                        float(high / tile.height), float((wide - 2 * left) / tile.width - 1),
                        float((high - 2 * below) / tile.height - 1));
    gl.Viewport(0, 0, tile.width, tile.height);
    const std::array<float, 4> nothing{};
    const float farthest = 1;
    gl.DepthMask(GL_TRUE);  // the tile before may have left it off
    gl.ClearNamedFramebufferfv(target.id(), GL_COLOR, 0, nothing.data());
    gl.ClearNamedFramebufferfv(target.id(), GL_DEPTH, 0, &farthest);
    gl.BindVertexArray(vertices.id());
    gl.Enable(GL_DEPTH_TEST);
    gl.DepthFunc(GL_LESS);
    gl.Enable(GL_CULL_FACE);
    const auto drawBricks = [&] {
        gl.BindFramebuffer(GL_FRAMEBUFFER, hasLines ? lines->target().id() : target.id());
        if (hasLines) lines->bind(gl);
        gl.UseProgram(program);
        gl.DepthMask(GL_FALSE);
        gl.CullFace(GL_FRONT);
        gl.Enable(GL_BLEND);
        gl.BlendFuncSeparate(GL_ONE_MINUS_DST_ALPHA, GL_ONE, GL_ONE_MINUS_DST_ALPHA, GL_ONE);
    };
    const auto closePixels = [&] {
        gl.BindFramebuffer(GL_FRAMEBUFFER, closing.id());
        gl.UseProgram(close->id());
        gl.BindTextureUnit(0, color.id());
        gl.DepthMask(GL_TRUE);
        gl.CullFace(GL_BACK);
        gl.Disable(GL_BLEND);
        gl.DrawArrays(GL_TRIANGLES, 0, 3);
        ++counts.draws;
    };
    const std::size_t part = std::max(kFewBricks, brickCount / kParts);
    std::size_t open = 0;
    drawBricks();
    for (const Run& run : runs) {
        for (std::size_t done = 0; done < run.count;) {
            const std::size_t count = std::min(run.count - done, part - open);
            gl.BindTextureUnit(0, pool.codes(run.atlas, group).id());
            gl.BindTextureUnit(1, pool.coverage(run.atlas, group).id());
            gl.ProgramUniform1i(program, bricks->uniform("atlas"), run.atlas);
            gl.ProgramUniform1i(program, bricks->uniform("firstBrick"), int(run.first + done));
            gl.DrawArraysInstanced(GL_TRIANGLES, 0, 36, GLsizei(count));
            ++counts.draws;
            done += count;
            open += count;
            if (open < part) continue;
            open = 0;
            closePixels();
            drawBricks();
        }
    }
    if (hasLines) {
        lines->compose(gl);
        ++counts.draws;
    }
}

SliceRenderer::SliceRenderer(GlThread& thread)
    : thread_(thread), device_(new Device, [&thread](Device* device) { thread.dispose(device); }) {}

SliceRenderer::~SliceRenderer() = default;

RgbaImage SliceRenderer::draw(const BrickPool& pool, const PoolState& state, const BrickFrame& frame,
                              std::span<const PlacedBrick> bricks, const RenderOptions& options,
                              const Execution& execution, RenderCounts* counts) {
    checkOptions(pool, options);
    const bool hasNumbers = std::ranges::any_of(options.effects, &Effect::needsBrickNumbers);
    if (hasNumbers && options.brickNumbers.size() != bricks.size())
        throw InputError("an effect needs a number for each brick");
    const Scene scene(pool, frame, bricks, options);
    const std::vector<const PlacedBrick*> seen = scene.inOrder(bricks);
    std::vector<DeviceBrick> placed;
    std::vector<Run> runs;
    for (const PlacedBrick* brick : seen) {
        const int atlas = pool.layout().atlasOf(brick->slot);
        if (runs.empty() || runs.back().atlas != atlas) runs.push_back({atlas, placed.size(), 0});
        ++runs.back().count;
        placed.push_back(scene.placed(*brick));
        if (!hasNumbers) continue;
        const float number = options.brickNumbers[std::size_t(brick - bricks.data())];
        placed.back().effectNumber = std::isfinite(number) ? number : -1;
    }
    const std::vector<DeviceStop> stops = scene.stops();
    const int side = int(std::lround(std::sqrt(options.samplesAPixel)));  // rays along a pixel's edge
    RgbaImage image{options.camera.widthPixels, options.camera.heightPixels, {}};
    image.pixels.resize(std::size_t(image.width) * std::size_t(image.height));
    RenderCounts count;
    count.bricks = std::int64_t(seen.size());
    count.unseenBricks = std::int64_t(bricks.size() - seen.size());
    LineView lineView{options.camera, options.boundsWorld};
    for (const PlacedBrick& brick : bricks)
        lineView.coarsestSpacingWorld =
            std::max(lineView.coarsestSpacingWorld, frame.spacingWorld(brick.key.depth));
    std::vector<LineSegment> segments = linesOf(options.effects, lineView).segments;
    for (LineSegment& segment : segments) segment.widthPixels *= options.lineScale;
    const ProjectedLines lines = projectLines(segments, options.within, options.camera, scene.eye(), side);
    const bool hasLines = !lines.lines.empty();
    if (seen.empty() && !hasLines) {
        if (counts) *counts = count;
        return image;
    }

    const int pixelsATile = std::clamp(options.raysATile, kLeastTile, kTile) / side;
    const Vec3i picture(image.width * side, image.height * side, 1);
    const std::size_t group = std::size_t(options.channel) / kChannelsAGroup;
    std::vector<Rgba> rays;
    // In tasks of a tile, so that others of the thread come between.
    struct Uploaded {
        GlBuffer bricks, stops;
        std::vector<EffectTexture> textures;
    };
    const std::shared_ptr<Uploaded> uploaded(new Uploaded,
                                             [this](Uploaded* buffers) { thread_.dispose(buffers); });
    const auto bindBuffers = [&](const GlFunctions& gl) {
        if (state.index) gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 2, state.index->id());
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, uploaded->bricks.id());
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, uploaded->stops.id());
    };
    thread_.run([&](GlContext& context) {
        device_->prepare(context, pool.brickCells(), options.effects, hasLines);
        count.passes = 1 + (hasLines ? LinePass::kPasses : 0);
        count.textures = 2 + (hasLines ? LinePass::kTextures : 0);
        if (hasLines) device_->lines->take(context, lines, scene.view(), scene.raySize());
        uploaded->bricks = GlBuffer(context, std::span(placed));
        uploaded->stops = GlBuffer(context, std::span(stops));
        count.deviceBytes = uploaded->bricks.bytes() + uploaded->stops.bytes() +
                            std::int64_t(kTile) * kTile * std::int64_t(sizeof(Rgba) + sizeof(float)) +
                            (hasLines ? device_->lines->deviceBytes() : 0);
    });
    for (const Effect& effect : options.effects) {
        if (!effect.makeTextures) continue;
        execution.throwIfCancelled();
        thread_.run([&](GlContext& context) {
            const GlFunctions& gl = context.functions();
            const Timer timer;
            bindBuffers(gl);
            EffectPass pass({context, pool, options.effects, options.within, options.channel,
                             [&](const GlProgram& program) { return scene.forEffects(gl, program); },
                             device_->passPrograms});
            EffectResources& made = count.effects.emplace_back();
            made.name = effect.name;
            for (EffectTexture& texture : effect.makeTextures(pass)) {
                ++made.textures;
                made.bytes += texture.bytes;
                uploaded->textures.push_back(std::move(texture));
            }
            made.passes = pass.passes();
            count.passes += made.passes;
            count.textures += made.textures;
            count.deviceBytes += made.bytes;
            if (options.measuresDevice) {
                gl.Finish();
                count.deviceMs += timer.elapsedMs();
            }
            count.drawMs += timer.elapsedMs();
        });
    }
    for (int top = 0; top < image.height; top += pixelsATile)
        for (int left = 0; left < image.width; left += pixelsATile) {
            if (options.beforeTile) options.beforeTile();
            execution.throwIfCancelled();
            const int wide = std::min(pixelsATile, image.width - left);
            const int high = std::min(pixelsATile, image.height - top);
            const PictureTile tile{left * side, top * side, wide * side, high * side};
            rays.resize(std::size_t(tile.width) * std::size_t(tile.height));
            thread_.run([&](GlContext& context) {
                const GlFunctions& gl = context.functions();
                const Timer timer;
                std::optional<GlQuery> elapsed;
                if (options.measuresDevice) {
                    elapsed.emplace(context, GL_TIME_ELAPSED);
                    elapsed->begin();
                }
                if (hasLines) {
                    device_->lines->drawLines(gl, tile, picture);
                    ++count.draws;
                }
                device_->setUniforms(gl, scene, pool, options);
                bindBuffers(gl);
                device_->bindTextures(gl, uploaded->textures);
                device_->draw(context, pool, runs, placed.size(), tile, picture, group, hasLines, count);
                if (elapsed) {
                    elapsed->end();
                    const double byDevice = 1e-6 * double(elapsed->result()), byClock = timer.elapsedMs();
                    // llvmpipe counts from its start at times, after compute shaders.
                    count.deviceMs += byDevice > 0 && byDevice < byClock ? byDevice : byClock;
                }
                gl.GetTextureSubImage(device_->color.id(), 0, 0, 0, 0, tile.width, tile.height, 1, GL_RGBA,
                                      GL_FLOAT, GLsizei(rays.size() * sizeof(Rgba)), rays.data());
                count.drawMs += timer.elapsedMs();
            });
            // Rows come from below.
            for (int y = 0; y < high; ++y)
                for (int x = 0; x < wide; ++x) {
                    std::array<double, 4> sum{};
                    for (int j = 0; j < side; ++j)
                        for (int i = 0; i < side; ++i) {
                            const std::size_t row = std::size_t(tile.height - 1 - (y * side + j));
                            const Rgba& ray = rays[row * std::size_t(tile.width) + std::size_t(x * side + i)];
                            for (std::size_t c = 0; c < 4; ++c) sum[c] += double(ray[c]);
                        }
                    Rgba& pixel = image.at(left + x, top + y);
                    for (std::size_t c = 0; c < 4; ++c) pixel[c] = float(sum[c] / (side * side));
                }
        }
    if (counts) *counts = count;
    return image;
}

}  // namespace tessera
