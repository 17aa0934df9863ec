#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "device/texture_slots.h"
#include "gl/gl_program.h"
#include "gl/gl_thread.h"
#include "raster/hard_elements.h"
#include "raster/point_scan.h"
#include "raster/prepared_region.h"
#include "raster/primitive_maker.h"
#include "raster/record_maker.h"
#include "tessera/resampler.h"

namespace tessera {

/// What the device has measured and counted since RasterDevice::begin().
struct RasterCounts {
    double uploadMs = 0, renderMs = 0, readBackMs = 0;
    std::int64_t fragments = 0, vertices = 0, uploadBytes = 0, readBackBytes = 0;
    std::int64_t polygons = 0;  ///< of primitives that the device made
};

/// Memory that the device copies to and the processor reads.
struct ReadBuffer {
    GlBuffer buffer;
    const std::byte* mapped = nullptr;
    GlFence filled;
};

/// A rendered region: codes of `components` floats a point, pixel by pixel, row by row, layer by layer. It
/// must not outlive its device.
struct RasterImage {
    int components = 1;
    std::span<const float> codes;
    /// Of the normalised formats: 0, or 1 + a bit a channel that isn't finite.
    std::span<const std::uint8_t> coverage;
    std::shared_ptr<const ReadBuffer> memory;  ///< where both stand; used again when the last image lets go
    bool isFilled = false;                     ///< else RasterDevice::waitFor() it
};

/// Renders the slabs of one region after another into a layered target. All functions but the constructor run
/// on the device's OpenGL thread; whoever renders holds `exclusive` from the first begin() to the last
/// readBack().
class RasterDevice {
  public:
    RasterDevice(GlThread& thread);

    GlThread& thread() { return thread_; }
    std::mutex exclusive;

    /// Clears the target for a region and takes its records. The passes over a region follow one another.
    /// @param scans the region is scanned, not drawn.
    void begin(GlContext& context, const PreparedRegion& region, const RasterInputs& inputs,
               std::size_t pass = 0, bool scans = false);
    /// The same of the region that records() are of; makes their channels.
    void begin(GlContext& context, const IndexBox& points, const RasterInputs& inputs, std::size_t pass,
               const DeviceMesh& mesh, bool scans);
    /// Of records that are made on the device.
    RecordMaker& records() { return records_; }
    /// Samples the region by compute shaders, layers along z. The boxes and the places of the points are
    /// those of the first pass.
    void scan(GlContext& context, const ScanBoxes& boxes, const std::vector<DecidedPoint>& points,
              std::size_t pass, bool isLast);
    void scan(GlContext& context, const ScanRecords& records, const std::vector<DecidedPoint>& points,
              std::size_t pass, bool isLast);
    /// Adds to the bytes that takeCounts() gives.
    void countUpload(std::int64_t bytes) { counts_.uploadBytes += bytes; }
    /// Draws what a generator made. Each slice may be drawn by one call only.
    void draw(GlContext& context, const SliceBatch& batch);
    /// Draws the region that records() are of by primitives that the device makes, at most so many bytes at a
    /// time.
    void draw(GlContext& context, const DeviceMesh& mesh, const ShaderText& algorithm,
              const LayerCounts& layers, std::int64_t mostBytes);
    void draw(GlContext& context, const std::vector<DecidedPoint>& points);
    /// Copies the region to the processor's memory, which goes on while the device is given other work.
    RasterImage readBack(GlContext& context);
    void waitFor(GlContext& context, RasterImage& image);
    RasterCounts takeCounts();

    /// Copies some points of the region, rendered with layers along z and its lowest point at `origin`, to
    /// their place in a slot. finishRegion() ends the region.
    void copyTo(GlContext& context, const IndexBox& points, const SlotPlace& place, const Vec3i& origin);
    /// In place of readBack() where samples stay: collects the queries and gives the records' buffers back.
    void finishRegion(GlContext& context);

    /// Renders layer by layer, as on devices that can't choose a layer in the vertex shader; for tests.
    void forbidVertexShaderLayer() { isLayered_ = false; }
    /// Scans with room for one contested point, so that all are found the other way; for tests.
    void allowOneContender() { isTight_ = true; }

  private:
    enum class Stage {
        sprites,
        polygons,
        points,
        silhouettes,
        gouraud,
        // Of a scan: what elements and decided points note in each of three ways, and the rest.
        elementFirst,
        elementOrders,
        elementRanks,
        pointFirst,
        pointOrders,
        pointRanks,
        plan,
        clear,
        contenders0,
        contenders1,
        contenders2,
        contenders3,
        values
    };
    struct Variant {
        Stage stage;
        bool isThin;
        int channels, levels;
        auto operator<=>(const Variant&) const = default;
    };
    struct Target {
        GlTexture codes, coverage, depth;
        GlFramebuffer framebuffer;
        Vec3i size{0};  ///< s, t, layers
        GLenum format = 0;
    };
    /// Buffers of a ring. What is filled once a pass over a region is large, and used until
    /// finishRegion().
    static constexpr std::size_t kOfRegions = 2, kOfBatches = 4;
    /// A ring of persistently mapped buffers that grow: the processor fills one while the device reads
    /// others.
    struct Stream {
        struct Slot {
            GlBuffer buffer;
            void* mapped = nullptr;
            GlFence read;
        };
        explicit Stream(std::size_t buffers) : slots(buffers) {}
        std::vector<Slot> slots;
        std::size_t next = 0, filled = 0;
    };

    /// Buffers that no image holds.
    struct FreeBuffers {
        std::mutex mutex;
        std::vector<std::unique_ptr<ReadBuffer>> buffers;
    };
    std::shared_ptr<ReadBuffer> takeReadBuffer(GlContext& context, std::int64_t bytes);
    const GlProgram& program(GlContext& context, const Variant& variant);
    /// What begin() does in any case; false when a pass before it failed.
    bool prepare(GlContext& context, const IndexBox& points, const RasterInputs& inputs, std::size_t pass,
                 bool scans);
    GlProgram makeScanProgram(GlContext& context, const Variant& variant, std::vector<ShaderDefine> defines);
    void prepareTarget(GlContext& context, const Vec3i& size, bool scans);
    void prepareScan(GlContext& context);
    void findOwners(GlContext& context, const ScanRecords& records, std::size_t points, GLuint pointBuffer);
    const GlProgram& useScan(GlContext& context, const Variant& variant);
    void bindRecords(GlContext& context, const ScanRecords& records);
    /// Of what is given to the device between them.
    void startTimer(GlContext& context);
    void stopTimer(GlContext& context);
    void clear(GlContext& context);
    void drawList(GlContext& context, const PrimitiveList& list, bool isThin);
    void drawSprites(GlContext& context, GLuint buffer, std::size_t count, bool areThin);
    void drawPolygons(GlContext& context, GLuint buffer, std::size_t count, bool areThin);
    void drawPublished(GlContext& context, const PublishedList& list);
    void makeAlphaTexture(GlContext& context);
    enum class Shape {
        points,
        triangles,  ///< by indices, three each
        quads       ///< of four vertices each
    };
    /// @param count of shapes.
    void drawPrimitives(GlContext& context, const Variant& variant, const GlVertexArray& array, Shape shape,
                        std::size_t count);
    void drawInParts(GlContext& context, Shape shape, std::size_t count);
    /// Waits until the device has read what stood there.
    GLuint upload(GlContext& context, Stream& stream, const void* bytes, std::size_t count);
    template <class T, class Memory>
    GLuint upload(GlContext& context, Stream& stream, const std::vector<T, Memory>& items) {
        return upload(context, stream, items.data(), items.size() * sizeof(T));
    }
    /// Marks that the device has been given all its work on what was last uploaded.
    void release(GlContext& context, Stream& stream);

    GlThread& thread_;
    bool isLayered_;
    bool countsFragments_;
    GlFence lastPart_;  ///< of a device that is emulated
    std::map<Variant, GlProgram> programs_;
    RecordMaker records_;
    PrimitiveMaker primitives_;
    GlBuffer quadIndices_;
    Target target_;
    std::shared_ptr<FreeBuffers> freeBuffers_ = std::make_shared<FreeBuffers>();
    Stream easyGeometry_{kOfRegions}, easyChannels_{kOfRegions}, thinGeometry_{kOfRegions},
        thinChannels_{kOfRegions}, published_{kOfRegions}, nodeCodes_{kOfRegions};
    Stream vertices_{kOfBatches}, indices_{kOfBatches};
    GlVertexArray spriteArray_, polygonArray_, pointArray_, silhouetteArray_, gouraudArray_;
    GlTexture alphaTexture_;
    GlBuffer owners_, orders_, contenders_;  ///< of a scan's points
    GlBuffer dispatches_;
    std::int64_t contenderRoom_ = 0;
    bool isTight_ = false;
    bool areOwnersClear_ = false;  ///< no scan was broken off
    std::vector<std::array<GlQuery, 2>> timers_;
    std::vector<GlQuery> fragmentCounters_;
    std::size_t usedQueries_ = 0;
    RasterCounts counts_;

    // Of the present region.
    SliceAxes axes_;
    Vec3i size_{0};  ///< s, t, layers
    int channels_ = 1;
    bool isFirstPass_ = true;
    SampleFormat format_ = SampleFormat::r32f;
    bool isReady_ = false;  ///< begin() of all passes so far came to its end; else draws, which nobody will
                            ///< see, do nothing
};

/// The process's device on a platform, made when first asked for; lives until the process ends.
/// @throws GlError when the platform is not available.
RasterDevice& sharedRasterDevice(GlPlatform platform);

}  // namespace tessera
