// What NanoVDB's headers look for to work in parallel and to compress.
#define NANOVDB_USE_TBB
#define NANOVDB_USE_BLOSC
#include "vdb/nvdb_write.h"

#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <ostream>

#include "base/check.h"
#include "files/atomic_file.h"
#include "refine/brick_result.h"
#include "tessera/error.h"
#include "vdb/openvdb_grids.h"

#ifdef __clang__
// Declared extern by OpenVDB's headers, but Debian's library has no instance of them; GCC makes its own.
template openvdb::Name openvdb::BoolGrid::gridType();
template openvdb::Name openvdb::FloatGrid::gridType();
template openvdb::Name openvdb::Vec3SGrid::gridType();
#endif

namespace tessera {
namespace {

/// Memory of a NanoVDB grid. NanoVDB's own isn't set to anything, and what it leaves between its nodes would
/// go into the file.
class ZeroedBuffer {
  public:
    static ZeroedBuffer create(std::uint64_t size, const ZeroedBuffer* = nullptr) {
        ZeroedBuffer buffer;
        const std::uint64_t rounded =
            (size + NANOVDB_DATA_ALIGNMENT - 1) / NANOVDB_DATA_ALIGNMENT * NANOVDB_DATA_ALIGNMENT;
        buffer.bytes_.reset(static_cast<std::uint8_t*>(std::aligned_alloc(NANOVDB_DATA_ALIGNMENT, rounded)));
        if (!buffer.bytes_) throw std::bad_alloc();
        std::memset(buffer.bytes_.get(), 0, rounded);
        buffer.size_ = size;
        return buffer;
    }
    std::uint8_t* data() { return bytes_.get(); }
    const std::uint8_t* data() const { return bytes_.get(); }
    std::uint64_t size() const { return size_; }
    void clear() {
        bytes_.reset();
        size_ = 0;
    }

  private:
    struct Free {
        void operator()(std::uint8_t* bytes) const { std::free(bytes); }
    };
    std::unique_ptr<std::uint8_t, Free> bytes_;
    std::uint64_t size_ = 0;
};

/// Averages and deviations would depend on how threads share the work, smallest and largest values don't.
constexpr auto kStatistics = nanovdb::StatsMode::MinMax;
constexpr auto kChecksum = nanovdb::ChecksumMode::Full;

template <class Grid>
nanovdb::GridHandle<ZeroedBuffer> convert(const Grid& grid) {
    return nanovdb::openToNanoVDB<ZeroedBuffer, typename Grid::TreeType>(grid, kStatistics, kChecksum);
}

nanovdb::GridHandle<ZeroedBuffer> convert(const openvdb::GridBase::Ptr& grid) {
    if (const auto scalar = openvdb::gridPtrCast<openvdb::FloatGrid>(grid)) return convert(*scalar);
    if (const auto vector = openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid)) return convert(*vector);
    const auto coverage = openvdb::gridPtrCast<openvdb::BoolGrid>(grid);
    TESSERA_CHECK(coverage, "grids hold floats, vectors or the coverage");
    openvdb::MaskGrid mask(
        std::make_shared<openvdb::MaskTree>(coverage->tree(), false, openvdb::TopologyCopy()));
    mask.setName(coverage->getName());
    mask.setTransform(coverage->transformPtr());
    return convert(mask);
}

}  // namespace

void checkNvdbOptions(const VdbWriteOptions& options) {
    if (options.halfFloat) throw InputError("--half: a .nvdb file holds no half floats; a .vdb file does");
}

VdbWriteResult writeNvdb(const std::string& path, const std::vector<OutputField>& fields, BrickResult& result,
                         const VdbWriteOptions& options, const Execution& execution) {
    checkNvdbOptions(options);
    TESSERA_CHECK(options.layout == VdbLayout::flat, "a NanoVDB file holds one grid a field");
    VdbWriteResult written;
    AtomicFile file(path);
    openvdb::GridPtrVec grids = buildVdbGrids(fields, result, options, written, execution);
    AtomicFileBuffer buffer(file, execution);
    std::ostream stream(&buffer);
    stream.exceptions(std::ios_base::badbit | std::ios_base::failbit);
    const int threadCount = execution.threadCount();
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, std::size_t(threadCount));
    tbb::task_arena threads(threadCount);
    for (std::size_t g = 0; g < grids.size(); ++g) {
        execution.throwIfCancelled();
        execution.report(Stage::writing, std::int64_t(g), std::int64_t(grids.size()));
        written.activeVoxels += std::int64_t(grids[g]->activeVoxelCount());
        const nanovdb::GridHandle<ZeroedBuffer> grid = threads.execute([&] { return convert(grids[g]); });
        grids[g].reset();  // one grid at a time is held twice
        nanovdb::io::writeGrid(stream, grid, nanovdb::io::Codec::BLOSC);
    }
    stream.flush();
    written.fileBytes = file.size();
    file.commit(execution);
    return written;
}

}  // namespace tessera
