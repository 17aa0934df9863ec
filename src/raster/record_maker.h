#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "gl/gl_program.h"
#include "raster/dispatch.h"
#include "raster/point_scan.h"
#include "raster/prepared_region.h"

namespace tessera {

/// Nodes, elements and coded values of a mesh in the device's memory. To be made and destroyed on the
/// device's OpenGL thread.
class DeviceMesh {
  public:
    /// What of a mesh the processor prepares, on any thread.
    struct Source {
        /// @param channels of whole fields. Elements that isSafeOnDevice() refuses are marked.
        Source(const TetMesh& mesh, std::span<const ChannelCoding> channels, SampleFormat format,
               const Execution& execution);

        struct Pass {
            std::vector<NodeCode> nodeCodes;  ///< node by node, channel by channel
            std::vector<float> cellCodes;
            std::uint32_t cellMask = 0;  ///< a bit a channel: it is of cells
            int channels = 1;
        };
        const TetMesh& whole;
        UninitializedVector<std::array<std::uint32_t, 4>> tets;
        std::vector<Pass> passes;
        Vec3d sizesWorld{0};  ///< of all elements together
    };
    DeviceMesh(GlContext& context, const Source& source);

    /// On the device, with what it takes to place the nodes in a lattice; not what regions take.
    static std::int64_t bytesOf(const TetMesh& mesh, std::span<const ChannelCoding> channels);
    std::int64_t uploadedBytes() const;
    /// The axis of a lattice along which elements reach the fewest layers.
    int layerAxis(const Vec3d& spacingWorld) const;

  private:
    friend class RecordMaker;
    struct Pass {
        GlBuffer nodeCodes, cellCodes;
        std::uint32_t cellMask;
        int channels;
    };
    std::size_t nodeCount_, elementCount_;
    Vec3d sizesWorld_;
    GlBuffer nodes_, tets_;
    std::vector<Pass> passes_;
};

/// How many elements of each kind, as ranks have it, reach each layer of a region.
inline constexpr std::size_t kKinds = 4;
using LayerCounts = std::vector<std::array<std::uint32_t, kKinds>>;

/// What a scan goes through, in buffers of the device.
struct ScanRecords {
    GLuint easyGeometry = 0, easyChannels = 0, thinGeometry = 0, thinChannels = 0, boxes = 0;
    std::vector<ScanRun> runs;
};

/// What the shaders that go by records know of the host's constants, but channels.
std::vector<ShaderDefine> recordDefines();

/// Makes the records and boxes of a region by compute shaders, from a mesh that is on the device: those that
/// prepareRegion() and listScanBoxes() make, bit for bit, but that boxes of a scan aren't tightened and
/// records of easy elements stand in gaps. All functions run on the device's OpenGL thread.
class RecordMaker {
  public:
    /// Whether operations on doubles give the bits of the processor's, as the records need it.
    bool isExact(GlContext& context);

    /// Places the mesh's nodes in an axis-parallel lattice, for all regions that follow.
    /// @param candidates when not empty, only these elements are looked at, and only their nodes placed.
    void place(GlContext& context, const DeviceMesh& mesh, const Lattice& lattice,
               std::span<const std::int32_t> candidates = {});

    /// Lists the elements that may have points in a region of at most kCellEdge points an axis; returns how
    /// many there are.
    std::int64_t findNear(GlContext& context, const DeviceMesh& mesh, const IndexBox& points);

    struct Made {
        std::vector<ScanRun> runs;       ///< of a scan
        LayerCounts layers;              ///< of what is drawn
        std::int64_t emptyPairs = 0;     ///< slices that an element reaches but has no point in
        std::vector<std::int32_t> hard;  ///< elements, ascending
    };
    /// The records of those elements but their channels, to be scanned or, with a layer axis, drawn. Null
    /// when they are more bytes, with the channels, than `most` or, unless that is kNoBound, than a buffer
    /// may hold.
    std::optional<Made> makeGeometry(GlContext& context, const DeviceMesh& mesh, std::int64_t most,
                                     std::optional<int> layerAxis = {});
    static constexpr std::int64_t kNoBound = std::numeric_limits<std::int64_t>::max();
    /// What records take when `listed` elements are listed.
    static std::int64_t bytesFor(std::int64_t listed, std::int64_t thin, int channels);
    void makeChannels(GlContext& context, const DeviceMesh& mesh, std::size_t pass, SampleFormat format);
    /// Of the last region, without its runs.
    ScanRecords records() const;
    /// The elements that it lists, ascending; for tests.
    std::vector<std::int32_t> listed(GlContext& context) const;
    /// Theirs; those without one have the rank ~0.
    std::vector<ScanBox> boxes(GlContext& context) const;

  private:
    friend class PrimitiveMaker;
    enum class Stage {
        frame,
        near,
        sums,
        list,
        easyGeometry,
        drawnGeometry,
        thinGeometry,
        channels,
        sort,
        counts,
        doubles
    };
    const GlProgram& program(GlContext& context, Stage stage, int channels = 0);
    ComputeUse use(GlContext& context, Stage stage, int channels = 0);
    void usePlaced(ComputeUse& used, const DeviceMesh& mesh) const;
    void useLookedAt(const ComputeUse& used, bool areLookedAt = true) const;
    /// Makes sums of all items before each; the sum of all stands behind them, at the place that is returned.
    std::size_t addUp(GlContext& context, const GlBuffer& items, std::size_t count, bool areBits,
                      GlBuffer& sums);
    /// Lists what is marked, ascending. @param areLookedAt marks are of what is looked at, and elements
    /// wanted.
    void list(GlContext& context, const GlBuffer& marks, const GlBuffer& sums, std::size_t words,
              const GlBuffer& listed, bool areLookedAt = false);
    /// Both give the number of hard elements, and note that of thin ones.
    std::size_t countBuckets(GlContext& context, std::size_t thinTotal, std::vector<ScanRun>& runs);
    std::size_t countLayers(GlContext& context, std::size_t thinTotal, Made& made);
    static std::int64_t largestBuffer(std::int64_t listed, std::int64_t thin, int channels);
    void makeThinGeometry(GlContext& context, const DeviceMesh& mesh);

    std::map<std::pair<Stage, int>, GlProgram> programs_;
    std::optional<bool> isExact_;
    GlBuffer frame_, rough_, candidates_;
    GlBuffer marks_, markSums_, listed_;
    GlBuffer easyGeometry_, easyChannels_, thinGeometry_, thinChannels_;
    GlBuffer boxes_, sorted_, thinMarks_, thinSums_, thinSlots_, boxCounts_, bucketSums_, hard_, counts_;
    IndexBox points_;
    std::size_t lookedAt_ = 0, listedCount_ = 0, thinCount_ = 0;
};

}  // namespace tessera
