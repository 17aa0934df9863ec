#include "raster/raster_device.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/timer.h"
#include "gl/gl_platform.h"
#include "raster/dispatch.h"
#include "raster/hard_elements.h"
#include "raster/shaders.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Sprites may hang over a region's upper edges by less than their own edge.
constexpr int kPadding = kSmallExtent + 2;
/// Voxels to depth: steps of 2^-11 voxel up to kLargestHeight.
constexpr const char* kDepthScale = "1.220703125e-4";
/// Of a scan: dispatches that may be made once more, threads of one, and bytes of what it notes.
constexpr std::size_t kMostAgain = kMostScanRuns + 2;
constexpr std::size_t kThreadsAtOnce = std::size_t(1) << 28;
constexpr std::int64_t kOwnerBytes = 4, kContenderBytes = 16, kLeastContenders = 1 << 16;
/// An emulated device keeps some hundred bytes of each corner until it has drawn it.
constexpr std::size_t kCornersAtOnce = std::size_t(3) << 14;
constexpr std::size_t kQuadIndices = 6, kQuadsAtOnce = kCornersAtOnce / kQuadIndices;
constexpr GLenum kFragmentInvocations = 0x82F4;  // GL_ARB_pipeline_statistics_query

int levelsOf(SampleFormat format) {
    if (format == SampleFormat::r8) return 255;
    return format == SampleFormat::r16 ? 65535 : 0;
}

/// Counts while it lives: a query that stays open after a failure would keep all others from beginning.
class FragmentCount {
  public:
    explicit FragmentCount(GlQuery* query) : query_(query) {
        if (query_) query_->begin();
    }
    ~FragmentCount() {
        if (query_) query_->end();
    }
    FragmentCount(const FragmentCount&) = delete;

  private:
    GlQuery* query_;
};

}  // namespace

RasterDevice::RasterDevice(GlThread& thread)
    : thread_(thread),
      isLayered_(thread.info().hasVertexShaderLayer),
      countsFragments_(std::ranges::count(thread.info().extensions, "GL_ARB_pipeline_statistics_query") > 0) {
    const GlLimits& limits = thread.info().limits;
    if (limits.maxPointSize < kSmallExtent + 1)
        throw GlError("the largest points of this device have " + std::to_string(int(limits.maxPointSize)) +
                      " pixels; sampling needs " + std::to_string(kSmallExtent + 1));
    if (limits.subpixelBits < kSubpixelBits)
        throw GlError("this device places corners in steps of 2^-" + std::to_string(limits.subpixelBits) +
                      " pixel; sampling needs 2^-" + std::to_string(kSubpixelBits));
}

GLuint RasterDevice::upload(GlContext& context, Stream& stream, const void* bytes, std::size_t count) {
    const Timer timer;
    stream.filled = stream.next;
    stream.next = (stream.next + 1) % stream.slots.size();
    Stream::Slot& slot = stream.slots[stream.filled];
    if (slot.read) slot.read.wait();
    slot.read.reset();
    if (slot.buffer.bytes() < std::int64_t(count) || !slot.buffer) {
        constexpr GLbitfield kMapping = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
        const std::int64_t size = std::max<std::int64_t>(std::int64_t(count + count / 4), 4096);
        slot.buffer = GlBuffer();
        GlBuffer made(context, size, kMapping);
        slot.mapped = made.map(0, size, kMapping);
        slot.buffer = std::move(made);
    }
    if (count > 0) std::memcpy(slot.mapped, bytes, count);
    counts_.uploadBytes += std::int64_t(count);
    counts_.uploadMs += timer.elapsedMs();
    return slot.buffer.id();
}

void RasterDevice::release(GlContext& context, Stream& stream) {
    stream.slots[stream.filled].read = GlFence(context);
}

const GlProgram& RasterDevice::program(GlContext& context, const Variant& variant) {
    const auto found = programs_.find(variant);
    if (found != programs_.end()) return found->second;
    namespace text = shaders::raster;
    std::vector<ShaderDefine> defines{{"CHANNELS", std::to_string(variant.channels)},
                                      {"DEPTH_SCALE", kDepthScale}};
    if (variant.levels > 0) defines.push_back({"LEVELS", std::to_string(variant.levels)});
    if (variant.isThin) defines.push_back({"THIN"});
    if (variant.stage == Stage::sprites) defines.push_back({"SPRITE"});
    if (isLayered_) defines.push_back({"LAYERED"});
    if (variant.stage == Stage::silhouettes) defines.push_back({"SILHOUETTE"});
    const bool isPublished = variant.stage == Stage::silhouettes || variant.stage == Stage::gouraud;
    const std::vector<ShaderText> output{text::kDecide, text::kSampleCodes, text::kSampleOutput};
    GlProgram made =
        variant.stage >= Stage::elementFirst ? makeScanProgram(context, variant, defines)
        : isPublished                        ? makeProgram(context,
                                                           {{GL_VERTEX_SHADER, text::kPublishedVertex},
                                                            {GL_FRAGMENT_SHADER, text::kPublishedFragment, output}},
                                                           defines)
        : variant.stage == Stage::points
            ? makeProgram(context,
                          {{GL_VERTEX_SHADER, text::kPointVertex},
                           {GL_FRAGMENT_SHADER, text::kPointFragment, output}},
                          defines)
            : makeProgram(context,
                          {{GL_VERTEX_SHADER, text::kElementVertex, {text::kRecordTypes, text::kRecord}},
                           {GL_FRAGMENT_SHADER,
                            text::kElementFragment,
                            {text::kRecordTypes, text::kRecord, text::kDecide, text::kSampleCodes,
                             text::kSampleOutput}}},
                          defines);
    return programs_.emplace(variant, std::move(made)).first->second;
}

GlProgram RasterDevice::makeScanProgram(GlContext& context, const Variant& variant,
                                        std::vector<ShaderDefine> defines) {
    namespace text = shaders::raster;
    const Stage stage = variant.stage;
    if (stage == Stage::elementOrders || stage == Stage::pointOrders) defines.push_back({"ORDERS"});
    if (stage == Stage::elementRanks || stage == Stage::pointRanks) defines.push_back({"RANKS"});
    defines.push_back({"STEP", std::to_string(int(stage) - int(Stage::contenders0))});
    defines.push_back({"PART_POINTS", glslOf(std::size_t(kPartPoints))});
    defines.push_back({"MOST_AGAIN", glslOf(kMostAgain)});
    const auto made = [&](const ShaderText& main, std::vector<ShaderText> shared) {
        shared.insert(shared.begin(), {text::kThreads, text::kRanks});
        return makeComputeProgram(context, main, std::move(shared), defines);
    };
    switch (stage) {
        case Stage::plan:
            return made(text::kScanPlan, {text::kScanMarks});
        case Stage::clear:
            return made(text::kScanClear, {text::kScanMarks});
        case Stage::contenders0:
        case Stage::contenders1:
        case Stage::contenders2:
        case Stage::contenders3:
            return made(text::kScanContenders, {text::kRecordTypes, text::kRecord, text::kThinRecord,
                                                text::kDecide, text::kScanMarks, text::kDecidedPoints});
        case Stage::values:
            return made(text::kScanValues,
                        {text::kRecordTypes, text::kRecord, text::kThinRecord, text::kDecide,
                         text::kSampleCodes, text::kScanMarks, text::kDecidedPoints});
        case Stage::pointFirst:
        case Stage::pointOrders:
        case Stage::pointRanks:
            return made(text::kScanPoints, {text::kDecide, text::kScanMarks, text::kDecidedPoints});
        default:
            return made(text::kScanElements, {text::kRecordTypes, text::kRecord, text::kDecide,
                                              text::kScanMarks, text::kScanBoxes});
    }
}

void RasterDevice::prepareTarget(GlContext& context, const Vec3i& size, bool scans) {
    const GLenum format = textureFormat(format_, channels_);
    const bool fits = target_.format == format && (scans || target_.depth) && target_.size.x >= size.x &&
                      target_.size.y >= size.y && target_.size.z >= size.z;
    if (fits) return;
    const Vec3i room = target_.format == format ? glm::max(size, target_.size) : size;
    // The old one goes first, for its memory; the new one counts once it is whole.
    target_ = Target();
    Target made;
    made.size = room;
    made.format = format;
    made.codes = GlTexture(context, GL_TEXTURE_3D, format, room.x, room.y, room.z);
    if (needsCoverageTexture(format_))
        made.coverage = GlTexture(context, GL_TEXTURE_3D, GL_R8, room.x, room.y, room.z);
    if (!scans) {
        made.framebuffer = GlFramebuffer(context);
        made.depth = GlTexture(context, GL_TEXTURE_2D_ARRAY, GL_DEPTH_COMPONENT32F, room.x, room.y, room.z);
    }
    if (!scans && isLayered_) {
        made.framebuffer.attach(GL_COLOR_ATTACHMENT0, made.codes);
        made.framebuffer.attach(GL_DEPTH_ATTACHMENT, made.depth);
        if (made.coverage) made.framebuffer.attach(GL_COLOR_ATTACHMENT1, made.coverage);
        const GLenum buffers[2] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
        context.functions().NamedFramebufferDrawBuffers(made.framebuffer.id(), made.coverage ? 2 : 1,
                                                        buffers);
        made.framebuffer.throwIfIncomplete();
    }
    target_ = std::move(made);
}

void RasterDevice::clear(GlContext& context) {
    const GlFunctions& gl = context.functions();
    const float mark = sampleMarks(format_).uncovered;
    const float codes[4] = {mark, mark, mark, mark}, zero[4] = {0, 0, 0, 0};
    const GLenum layout = channels_ == 1 ? GL_RED : GL_RGBA;
    gl.ClearTexSubImage(target_.codes.id(), 0, 0, 0, 0, size_.x, size_.y, size_.z, layout, GL_FLOAT, codes);
    gl.ClearTexSubImage(target_.depth.id(), 0, 0, 0, 0, size_.x, size_.y, size_.z, GL_DEPTH_COMPONENT,
                        GL_FLOAT, zero);
    if (target_.coverage)
        gl.ClearTexSubImage(target_.coverage.id(), 0, 0, 0, 0, size_.x, size_.y, size_.z, GL_RED, GL_FLOAT,
                            zero);
}

void RasterDevice::begin(GlContext& context, const PreparedRegion& region, const RasterInputs& inputs,
                         std::size_t pass, bool scans) {
    const bool hasGeometry = prepare(context, region.points, inputs, pass, scans);
    if (!region.easy.geometry.empty()) {
        if (pass == 0) upload(context, easyGeometry_, region.easy.geometry);
        upload(context, easyChannels_, region.easy.channels[pass]);
    }
    if (!region.thin.geometry.empty()) {
        if (pass == 0) upload(context, thinGeometry_, region.thin.geometry);
        upload(context, thinChannels_, region.thin.channels[pass]);
    }
    if (!region.published.empty()) {
        if (pass == 0) upload(context, published_, region.published);
        upload(context, nodeCodes_, region.nodeCodes[pass]);
    }
    isReady_ = hasGeometry;
}

void RasterDevice::begin(GlContext& context, const IndexBox& points, const RasterInputs& inputs,
                         std::size_t pass, const DeviceMesh& mesh, bool scans) {
    const bool hasGeometry = prepare(context, points, inputs, pass, scans);
    context.functions().MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // draws of the pass before read them
    records_.makeChannels(context, mesh, pass, inputs.format);
    isReady_ = hasGeometry;
}

bool RasterDevice::prepare(GlContext& context, const IndexBox& points, const RasterInputs& inputs,
                           std::size_t pass, bool scans) {
    // Geometry stays where the first pass put it.
    const bool hasGeometry = pass == 0 || isReady_;
    isReady_ = false;
    isFirstPass_ = pass == 0;
    axes_ = inputs.axes;
    format_ = inputs.format;
    channels_ = inputs.recordedChannels(pass);
    usedQueries_ = 0;  // of a region that was broken off
    const Vec3i size = points.size();
    size_ = {size[axes_.s], size[axes_.t], size[axes_.l]};
    prepareTarget(context, size_ + Vec3i(kPadding, kPadding, 0), scans);
    if (!scans) clear(context);
    return hasGeometry;
}

/// At most two parts are under way on an emulated device.
void RasterDevice::drawInParts(GlContext& context, Shape shape, std::size_t count) {
    const GlFunctions& gl = context.functions();
    const bool isEmulated = thread_.info().isSoftware;
    const std::size_t most = shape == Shape::quads       ? kQuadsAtOnce
                             : !isEmulated               ? count
                             : shape == Shape::triangles ? kCornersAtOnce / 3
                                                         : kCornersAtOnce;
    for (std::size_t first = 0; first < count; first += most) {
        const auto ofPart = GLsizei(std::min(most, count - first));
        if (shape == Shape::points)
            gl.DrawArrays(GL_POINTS, GLint(first), ofPart);
        else if (shape == Shape::triangles)
            gl.DrawElements(GL_TRIANGLES, 3 * ofPart, GL_UNSIGNED_INT,
                            reinterpret_cast<const void*>(3 * first * sizeof(std::uint32_t)));
        else
            gl.DrawElementsBaseVertex(GL_TRIANGLES, GLsizei(kQuadIndices) * ofPart, GL_UNSIGNED_INT, nullptr,
                                      GLint(4 * first));
        if (!isEmulated) continue;
        GlFence part(context);
        if (lastPart_) lastPart_.wait();
        lastPart_ = std::move(part);
    }
}

void RasterDevice::drawPrimitives(GlContext& context, const Variant& variant, const GlVertexArray& array,
                                  Shape shape, std::size_t count) {
    const GlFunctions& gl = context.functions();
    const GlProgram& used = program(context, variant);
    gl.UseProgram(used.id());
    gl.BindVertexArray(array.id());
    // The viewport holds the padding too, so that the centres of overhanging sprites lie in it.
    const Vec3i room = size_ + Vec3i(kPadding, kPadding, 0);
    gl.Viewport(0, 0, room.x, room.y);
    gl.ProgramUniform2f(used.id(), used.uniform("clipFromPixel"), 2.0f / float(room.x), 2.0f / float(room.y));
    gl.ProgramUniform1i(used.id(), used.uniform("layerAxis"), axes_.l);
    const bool isPublished = variant.stage == Stage::silhouettes || variant.stage == Stage::gouraud;
    if (!isPublished) gl.Enable(GL_DEPTH_TEST);
    gl.DepthFunc(GL_GREATER);
    gl.Enable(GL_PROGRAM_POINT_SIZE);
    gl.ProvokingVertex(GL_FIRST_VERTEX_CONVENTION);
    gl.BindFramebuffer(GL_DRAW_FRAMEBUFFER, target_.framebuffer.id());
    if (isLayered_) return drawInParts(context, shape, count);
    const GLenum buffers[2] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    for (int layer = 0; layer < size_.z; ++layer) {
        target_.framebuffer.attachLayer(GL_COLOR_ATTACHMENT0, target_.codes, layer);
        target_.framebuffer.attachLayer(GL_DEPTH_ATTACHMENT, target_.depth, layer);
        if (target_.coverage) target_.framebuffer.attachLayer(GL_COLOR_ATTACHMENT1, target_.coverage, layer);
        gl.NamedFramebufferDrawBuffers(target_.framebuffer.id(), target_.coverage ? 2 : 1, buffers);
        gl.ProgramUniform1i(used.id(), used.uniform("onlyLayer"), layer);
        drawInParts(context, shape, count);
    }
}

void RasterDevice::drawList(GlContext& context, const PrimitiveList& list, bool isThin) {
    const GlFunctions& gl = context.functions();
    const Stream& geometry = isThin ? thinGeometry_ : easyGeometry_;
    const Stream& channels = isThin ? thinChannels_ : easyChannels_;
    if (list.sprites.empty() && list.corners.empty()) return;
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, geometry.slots[geometry.filled].buffer.id());
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, channels.slots[channels.filled].buffer.id());
    if (!list.sprites.empty()) {
        drawSprites(context, upload(context, vertices_, list.sprites), list.sprites.size(), isThin);
        release(context, vertices_);
    }
    if (!list.corners.empty()) {
        drawPolygons(context, upload(context, vertices_, list.corners), list.corners.size() / 4, isThin);
        release(context, vertices_);
    }
}

void RasterDevice::drawSprites(GlContext& context, GLuint buffer, std::size_t count, bool areThin) {
    const GlFunctions& gl = context.functions();
    if (!spriteArray_) {
        spriteArray_ = GlVertexArray(context);
        gl.EnableVertexArrayAttrib(spriteArray_.id(), 0);
        gl.VertexArrayAttribIFormat(spriteArray_.id(), 0, 3, GL_UNSIGNED_INT, 0);
        gl.VertexArrayAttribBinding(spriteArray_.id(), 0, 0);
    }
    gl.VertexArrayVertexBuffer(spriteArray_.id(), 0, buffer, 0, sizeof(Sprite));
    drawPrimitives(context, {Stage::sprites, areThin, channels_, levelsOf(format_)}, spriteArray_,
                   Shape::points, count);
    counts_.vertices += std::int64_t(count);
}

void RasterDevice::drawPolygons(GlContext& context, GLuint buffer, std::size_t count, bool areThin) {
    const GlFunctions& gl = context.functions();
    if (!polygonArray_) {
        // Two triangles each; the first corner provokes.
        std::vector<std::uint32_t> indices;
        for (std::uint32_t corner = 0; corner < 4 * kQuadsAtOnce; corner += 4)
            for (const std::uint32_t k : {0, 1, 2, 0, 2, 3}) indices.push_back(corner + k);
        GlBuffer quads(context, std::span(indices));
        polygonArray_ = GlVertexArray(context);
        const GLuint array = polygonArray_.id();
        gl.EnableVertexArrayAttrib(array, 0);
        gl.VertexArrayAttribFormat(array, 0, 2, GL_FLOAT, GL_FALSE, 0);
        gl.VertexArrayAttribBinding(array, 0, 0);
        gl.EnableVertexArrayAttrib(array, 1);
        gl.VertexArrayAttribIFormat(array, 1, 2, GL_UNSIGNED_INT, offsetof(PolygonVertex, record));
        gl.VertexArrayAttribBinding(array, 1, 0);
        gl.VertexArrayElementBuffer(array, quads.id());
        quadIndices_ = std::move(quads);
    }
    gl.VertexArrayVertexBuffer(polygonArray_.id(), 0, buffer, 0, sizeof(PolygonVertex));
    drawPrimitives(context, {Stage::polygons, areThin, channels_, levelsOf(format_)}, polygonArray_,
                   Shape::quads, count);
    counts_.vertices += std::int64_t(4 * count);
}

void RasterDevice::makeAlphaTexture(GlContext& context) {
    // Opaque but for a border of one texel, which the lookup is clamped to outside.
    constexpr int kSize = 66;
    std::vector<std::uint8_t> alpha(kSize * kSize, 0);
    for (int y = 1; y + 1 < kSize; ++y)
        std::fill_n(alpha.begin() + y * kSize + 1, kSize - 2, std::uint8_t(255));
    alphaTexture_ = GlTexture(context, GL_TEXTURE_2D, GL_R8, kSize, kSize);
    context.functions().TextureSubImage2D(alphaTexture_.id(), 0, 0, 0, kSize, kSize, GL_RED, GL_UNSIGNED_BYTE,
                                          alpha.data());
}

void RasterDevice::drawPublished(GlContext& context, const PublishedList& list) {
    if (list.indices.empty()) return;
    const GlFunctions& gl = context.functions();
    const bool isSilhouette = !list.silhouettes.empty();
    if (!alphaTexture_) {
        makeAlphaTexture(context);
        silhouetteArray_ = GlVertexArray(context);
        gl.EnableVertexArrayAttrib(silhouetteArray_.id(), 0);
        gl.VertexArrayAttribIFormat(silhouetteArray_.id(), 0, 2, GL_UNSIGNED_INT, 0);
        gl.VertexArrayAttribBinding(silhouetteArray_.id(), 0, 0);
        gouraudArray_ = GlVertexArray(context);
        const GLuint array = gouraudArray_.id();
        gl.VertexArrayAttribFormat(array, 0, 2, GL_FLOAT, GL_FALSE, 0);
        gl.VertexArrayAttribIFormat(array, 1, 1, GL_UNSIGNED_INT, offsetof(GouraudCorner, layer));
        gl.VertexArrayAttribFormat(array, 2, 4, GL_FLOAT, GL_FALSE, offsetof(GouraudCorner, codes));
        for (GLuint a = 0; a < 3; ++a) {
            gl.EnableVertexArrayAttrib(array, a);
            gl.VertexArrayAttribBinding(array, a, 0);
        }
    }
    const GlVertexArray& array = isSilhouette ? silhouetteArray_ : gouraudArray_;
    if (isSilhouette) {
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, published_.slots[published_.filled].buffer.id());
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, nodeCodes_.slots[nodeCodes_.filled].buffer.id());
        gl.BindTextureUnit(0, alphaTexture_.id());
        gl.VertexArrayVertexBuffer(array.id(), 0, upload(context, vertices_, list.silhouettes), 0,
                                   sizeof(SilhouetteCorner));
    } else {
        gl.VertexArrayVertexBuffer(array.id(), 0, upload(context, vertices_, list.polygons), 0,
                                   sizeof(GouraudCorner));
    }
    gl.VertexArrayElementBuffer(array.id(), upload(context, indices_, list.indices));
    drawPrimitives(context,
                   {isSilhouette ? Stage::silhouettes : Stage::gouraud, false, channels_, levelsOf(format_)},
                   array, Shape::triangles, list.indices.size() / 3);
    counts_.vertices += std::int64_t(list.silhouettes.size() + list.polygons.size());
    release(context, vertices_);
    release(context, indices_);
}

// Time stamps, not GL_TIME_ELAPSED: llvmpipe's first one counts from the machine's start.
void RasterDevice::startTimer(GlContext& context) {
    if (usedQueries_ == timers_.size())
        timers_.push_back({GlQuery(context, GL_TIMESTAMP), GlQuery(context, GL_TIMESTAMP)});
    if (countsFragments_ && usedQueries_ == fragmentCounters_.size())
        fragmentCounters_.emplace_back(context, kFragmentInvocations);
    context.functions().QueryCounter(timers_[usedQueries_][0].id(), GL_TIMESTAMP);
}

void RasterDevice::stopTimer(GlContext& context) {
    context.functions().QueryCounter(timers_[usedQueries_][1].id(), GL_TIMESTAMP);
    ++usedQueries_;
}

void RasterDevice::draw(GlContext& context, const SliceBatch& batch) {
    if (!isReady_) return;
    startTimer(context);
    {
        const FragmentCount count(countsFragments_ ? &fragmentCounters_[usedQueries_] : nullptr);
        drawList(context, batch.easy, false);
        drawList(context, batch.thin, true);
        drawPublished(context, batch.published);
    }
    stopTimer(context);
}

void RasterDevice::draw(GlContext& context, const DeviceMesh& mesh, const ShaderText& algorithm,
                        const LayerCounts& layers, std::int64_t mostBytes) {
    if (!isReady_) return;
    const GlFunctions& gl = context.functions();
    const ScanRecords records = records_.records();
    mostBytes =
        std::min(mostBytes, thread_.info().limits.storageBlockBytes / 5 * 4);  // buffers have some more
    for (const PrimitiveMaker::Slab& slab : PrimitiveMaker::slabs(layers, mostBytes))
        for (std::size_t kind = 0; kind < kKinds; ++kind) {
            if (slab.counts[kind] == 0) continue;
            startTimer(context);
            {
                const FragmentCount counter(countsFragments_ ? &fragmentCounters_[usedQueries_] : nullptr);
                gl.MemoryBarrier(GL_ALL_BARRIER_BITS);  // what is drawn by now has been read
                const auto made = primitives_.make(context, records_, mesh, axes_, algorithm, slab, kind);
                const bool areThin = isThinKind(kind);
                gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0,
                                  areThin ? records.thinGeometry : records.easyGeometry);
                gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 1,
                                  areThin ? records.thinChannels : records.easyChannels);
                if (isLargeKind(kind))
                    drawPolygons(context, made.buffer, made.count, areThin);
                else
                    drawSprites(context, made.buffer, made.count, areThin);
                if (isFirstPass_) counts_.polygons += std::int64_t(made.count);
            }
            stopTimer(context);
        }
}

void RasterDevice::draw(GlContext& context, const std::vector<DecidedPoint>& points) {
    if (!isReady_ || points.empty()) return;
    const GlFunctions& gl = context.functions();
    if (!pointArray_) {
        pointArray_ = GlVertexArray(context);
        const GLuint array = pointArray_.id();
        gl.VertexArrayAttribIFormat(array, 0, 2, GL_UNSIGNED_INT, 0);
        gl.VertexArrayAttribFormat(array, 1, 1, GL_FLOAT, GL_FALSE, offsetof(DecidedPoint, depth));
        gl.VertexArrayAttribFormat(array, 2, 4, GL_FLOAT, GL_FALSE, offsetof(DecidedPoint, codes));
        for (GLuint a = 0; a < 3; ++a) {
            gl.EnableVertexArrayAttrib(array, a);
            gl.VertexArrayAttribBinding(array, a, 0);
        }
    }
    gl.VertexArrayVertexBuffer(pointArray_.id(), 0, upload(context, vertices_, points), 0,
                               sizeof(DecidedPoint));
    drawPrimitives(context, {Stage::points, false, channels_, levelsOf(format_)}, pointArray_, Shape::points,
                   points.size());
    counts_.vertices += std::int64_t(points.size());
    release(context, vertices_);
}

void RasterDevice::prepareScan(GlContext& context) {
    const std::int64_t points = std::int64_t(size_.x) * size_.y * size_.z;
    if (!owners_ || !orders_ || owners_.bytes() < points * kOwnerBytes) {
        areOwnersClear_ = false;  // there may be room for one of them only
        owners_.reset();
        orders_.reset();
        owners_ = GlBuffer(context, points * kOwnerBytes, 0);
        orders_ = GlBuffer(context, points * kOwnerBytes, 0);
    }
    contenderRoom_ = isTight_ ? 1 : std::max<std::int64_t>(points / 2, kLeastContenders);
    const std::int64_t bytes = (contenderRoom_ + 1) * kContenderBytes;  // the count stands before them
    if (!contenders_ || contenders_.bytes() < bytes) {
        contenders_ = GlBuffer();
        contenders_ = GlBuffer(context, bytes, 0);
    }
    if (!dispatches_) dispatches_ = GlBuffer(context, 3 * (kMostAgain + 1) * sizeof(GLuint), 0);
    if (!areOwnersClear_) fill(context, owners_, std::size_t(owners_.bytes()));
    fill(context, contenders_, std::size_t(kContenderBytes));
    areOwnersClear_ = false;
}

void RasterDevice::bindRecords(GlContext& context, const ScanRecords& records) {
    const GlFunctions& gl = context.functions();
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, records.easyGeometry);
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, records.easyChannels);
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 4, records.thinGeometry);
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 5, records.thinChannels);
}

const GlProgram& RasterDevice::useScan(GlContext& context, const Variant& variant) {
    const GlProgram& used = program(context, variant);
    context.functions().UseProgram(used.id());
    context.functions().ProgramUniform3ui(used.id(), used.uniform("regionSize"), GLuint(size_.x),
                                          GLuint(size_.y), GLuint(size_.z));
    context.functions().ProgramUniform1ui(used.id(), used.uniform("contenderRoom"), GLuint(contenderRoom_));
    return used;
}

void RasterDevice::findOwners(GlContext& context, const ScanRecords& records, std::size_t points,
                              GLuint pointBuffer) {
    const GlFunctions& gl = context.functions();
    const std::size_t all = std::size_t(size_.x) * std::size_t(size_.y) * std::size_t(size_.z);
    const auto mostBoxes = [](const ScanRun& run) { return kThreadsAtOnce >> run.partBits; };
    // Of all points, decided points, and runs of boxes.
    constexpr std::size_t ofAll = 0, ofDecided = 1, ofRuns = 2;
    std::vector<std::array<GLuint, 3>> groups{groupsOf(all), groupsOf(points)};
    for (const ScanRun& run : records.runs)
        groups.push_back(groupsOf(std::min(run.count, mostBoxes(run)) << run.partBits));
    const auto dispatchPlanned = [&](std::size_t i) {
        gl.BindBuffer(GL_DISPATCH_INDIRECT_BUFFER, dispatches_.id());
        gl.DispatchComputeIndirect(GLintptr(i * sizeof(groups[0])));
    };
    const auto dispatch = [&](std::size_t i, bool isPlanned) {
        if (isPlanned)
            dispatchPlanned(i + 1);
        else
            gl.DispatchCompute(groups[i][0], groups[i][1], groups[i][2]);
    };
    // Owners don't depend on channels.
    const auto use = [&](Stage stage, bool isThin = false) -> const GlProgram& {
        return useScan(context, {stage, isThin, 1, 0});
    };
    const auto noteAll = [&](Stage ofElements, Stage ofPoints, bool isPlanned) {
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 5, records.boxes);
        for (std::size_t r = 0; r < records.runs.size(); ++r) {
            const ScanRun& run = records.runs[r];
            gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0,
                              run.isThin ? records.thinGeometry : records.easyGeometry);
            const GlProgram& used = use(ofElements, run.isThin);
            gl.ProgramUniform1ui(used.id(), used.uniform("partBits"), run.partBits);
            std::size_t first = 0;
            do {
                const std::size_t count = std::min(mostBoxes(run), run.count - first);
                gl.ProgramUniform1ui(used.id(), used.uniform("firstBox"), GLuint(run.first + first));
                gl.ProgramUniform1ui(used.id(), used.uniform("boxCount"), GLuint(count));
                dispatch(ofRuns + r, isPlanned);
                first += count;
            } while (first < run.count);
        }
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 6, pointBuffer);
        const GlProgram& used = use(ofPoints);
        gl.ProgramUniform1ui(used.id(), used.uniform("pointCount"), GLuint(points));
        dispatch(ofDecided, isPlanned);
        gl.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    };
    if (std::int64_t(all) <= kFewPoints) {
        fill(context, orders_, all * std::size_t(kOwnerBytes));
        noteAll(Stage::elementOrders, Stage::pointOrders, false);
        noteAll(Stage::elementRanks, Stage::pointRanks, false);
        return;
    }
    noteAll(Stage::elementFirst, Stage::pointFirst, false);
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 5, dispatches_.id());
    const GlProgram& plan = use(Stage::plan);
    gl.ProgramUniform3uiv(plan.id(), plan.uniform("groupsAgain"), GLsizei(groups.size()), groups[0].data());
    gl.ProgramUniform1ui(plan.id(), plan.uniform("againCount"), GLuint(groups.size()));
    gl.DispatchCompute(1, 1, 1);
    gl.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_COMMAND_BARRIER_BIT);
    bindRecords(context, records);
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 6, pointBuffer);
    for (const Stage stage :
         {Stage::contenders0, Stage::contenders1, Stage::contenders2, Stage::contenders3}) {
        use(stage);
        dispatchPlanned(0);
        gl.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    }
    const GlProgram& clear = use(Stage::clear);
    gl.ProgramUniform1ui(clear.id(), clear.uniform("pointCount"), GLuint(all));
    dispatch(ofAll, true);
    gl.MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    noteAll(Stage::elementOrders, Stage::pointOrders, true);
    noteAll(Stage::elementRanks, Stage::pointRanks, true);
}

void RasterDevice::scan(GlContext& context, const ScanBoxes& boxes, const std::vector<DecidedPoint>& points,
                        std::size_t pass, bool isLast) {
    if (!isReady_) return;
    const auto idOf = [](const Stream& stream) { return stream.slots[stream.filled].buffer.id(); };
    ScanRecords records{idOf(easyGeometry_), idOf(easyChannels_), idOf(thinGeometry_), idOf(thinChannels_), 0,
                        boxes.runs};
    if (pass == 0) records.boxes = upload(context, vertices_, boxes.boxes);
    scan(context, records, points, pass, isLast);
    if (pass == 0) release(context, vertices_);
}

void RasterDevice::scan(GlContext& context, const ScanRecords& records,
                        const std::vector<DecidedPoint>& points, std::size_t pass, bool isLast) {
    if (!isReady_) return;
    const GlFunctions& gl = context.functions();
    startTimer(context);
    const FragmentCount count(countsFragments_ ? &fragmentCounters_[usedQueries_] : nullptr);
    if (pass == 0) prepareScan(context);
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 2, orders_.id());
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 3, owners_.id());
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 7, contenders_.id());
    const GLuint pointBuffer = upload(context, indices_, points);
    if (pass == 0) findOwners(context, records, points.size(), pointBuffer);
    bindRecords(context, records);
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 6, pointBuffer);
    const GlProgram& used = useScan(context, {Stage::values, false, channels_, levelsOf(format_)});
    gl.ProgramUniform1f(used.id(), used.uniform("uncovered"), sampleMarks(format_).uncovered);
    gl.ProgramUniform1i(used.id(), used.uniform("isLast"), isLast);
    gl.BindImageTexture(0, target_.codes.id(), 0, GL_TRUE, 0, GL_WRITE_ONLY, target_.format);
    if (target_.coverage) gl.BindImageTexture(1, target_.coverage.id(), 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_R8);
    gl.DispatchCompute(GLuint((std::size_t(size_.x) + kGroupThreads - 1) / kGroupThreads), GLuint(size_.y),
                       GLuint(size_.z));
    gl.MemoryBarrier(GL_ALL_BARRIER_BITS);
    stopTimer(context);
    release(context, indices_);
    areOwnersClear_ = isLast;
}

void RasterDevice::finishRegion(GlContext& context) {
    for (Stream* stream :
         {&easyGeometry_, &easyChannels_, &thinGeometry_, &thinChannels_, &published_, &nodeCodes_})
        if (stream->slots[stream->filled].buffer) release(context, *stream);
    for (std::size_t q = 0; q < usedQueries_; ++q) {
        counts_.renderMs += double(timers_[q][1].result() - timers_[q][0].result()) * 1e-6;
        if (countsFragments_) counts_.fragments += std::int64_t(fragmentCounters_[q].result());
    }
    usedQueries_ = 0;
}

std::shared_ptr<ReadBuffer> RasterDevice::takeReadBuffer(GlContext& context, std::int64_t bytes) {
    constexpr GLbitfield kMapping = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    std::unique_ptr<ReadBuffer> taken;
    {
        const std::lock_guard lock(freeBuffers_->mutex);
        auto& buffers = freeBuffers_->buffers;
        const auto fits = [&](const auto& free) { return free->buffer.bytes() >= bytes; };
        auto found = std::ranges::find_if(buffers, fits);
        if (found == buffers.end() && !buffers.empty())
            found = buffers.begin();  // makes room for a larger one
        if (found != buffers.end()) {
            taken = std::move(*found);
            buffers.erase(found);
        }
    }
    if (!taken || taken->buffer.bytes() < bytes) {
        taken.reset();
        taken = std::make_unique<ReadBuffer>();
        taken->buffer = GlBuffer(context, bytes, kMapping | GL_CLIENT_STORAGE_BIT);
        taken->mapped = static_cast<const std::byte*>(taken->buffer.map(0, bytes, kMapping));
    }
    return {taken.release(), [free = freeBuffers_](ReadBuffer* buffer) {
                const std::lock_guard lock(free->mutex);
                free->buffers.emplace_back(buffer);
            }};
}

RasterImage RasterDevice::readBack(GlContext& context) {
    const GlFunctions& gl = context.functions();
    finishRegion(context);
    const Timer timer;
    RasterImage image;
    image.components = channels_ == 1 ? 1 : 4;
    const auto pixels = std::size_t(size_.x) * std::size_t(size_.y) * std::size_t(size_.z);
    const std::size_t codes = pixels * std::size_t(image.components);
    const std::size_t codeBytes = codes * sizeof(float), coverage = target_.coverage ? pixels : 0;
    const std::shared_ptr<ReadBuffer> memory =
        takeReadBuffer(context, std::int64_t(std::max<std::size_t>(4, codeBytes + coverage)));
    const auto copy = [&](const GlTexture& texture, GLenum format, GLenum type, std::size_t bytes,
                          std::size_t to) {
        gl.GetTextureSubImage(texture.id(), 0, 0, 0, 0, size_.x, size_.y, size_.z, format, type,
                              GLsizei(bytes), reinterpret_cast<void*>(to));
    };
    gl.BindBuffer(GL_PIXEL_PACK_BUFFER, memory->buffer.id());
    copy(target_.codes, image.components == 1 ? GL_RED : GL_RGBA, GL_FLOAT, codeBytes, 0);
    if (target_.coverage) copy(target_.coverage, GL_RED, GL_UNSIGNED_BYTE, coverage, codeBytes);
    gl.BindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    memory->filled = GlFence(context);
    image.isFilled = memory->filled.isSignaled();
    image.codes = {reinterpret_cast<const float*>(memory->mapped), codes};
    image.coverage = {reinterpret_cast<const std::uint8_t*>(memory->mapped + codeBytes), coverage};
    image.memory = memory;
    counts_.readBackMs += timer.elapsedMs();
    counts_.readBackBytes += std::int64_t(codeBytes + coverage);
    return image;
}

void RasterDevice::waitFor(GlContext&, RasterImage& image) {
    const Timer timer;
    image.memory->filled.wait();
    image.isFilled = true;
    counts_.readBackMs += timer.elapsedMs();
}

void RasterDevice::copyTo(GlContext& context, const IndexBox& points, const SlotPlace& place,
                          const Vec3i& origin) {
    const GlFunctions& gl = context.functions();
    const Vec3i from = points.min - origin, size = points.size();
    const auto copy = [&](const GlTexture& source, const GlTexture& to) {
        gl.CopyImageSubData(source.id(), GL_TEXTURE_3D, 0, from.x, from.y, from.z, to.id(), GL_TEXTURE_3D, 0,
                            place.at.x, place.at.y, place.at.z, size.x, size.y, size.z);
    };
    copy(target_.codes, *place.codes);
    if (target_.coverage) copy(target_.coverage, *place.coverage);
}

RasterCounts RasterDevice::takeCounts() {
    // A run leaves the memory of two images behind, for the next one.
    const std::lock_guard lock(freeBuffers_->mutex);
    if (freeBuffers_->buffers.size() > 2) freeBuffers_->buffers.resize(2);
    return std::exchange(counts_, {});
}

RasterDevice& sharedRasterDevice(GlPlatform platform) {
    // Never destroyed, like the threads they draw on.
    static std::mutex mutex;
    static auto& devices = *new std::map<GlPlatform, std::unique_ptr<RasterDevice>>();
    const std::lock_guard lock(mutex);
    std::unique_ptr<RasterDevice>& device = devices[platform];
    if (!device) device = std::make_unique<RasterDevice>(sharedGlThread(platform));
    return *device;
}

}  // namespace tessera
