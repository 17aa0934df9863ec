#pragma once

#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <unordered_map>

#include "brick/root_grid.h"
#include "refine/brick_plan.h"
#include "schedule/brick_archive.h"
#include "tessera/mesh.h"

namespace tessera {

/// A file to which bricks are appended as they are sampled. What a killed program had appended is there when
/// the file is opened again; a brick that was cut off at the end is dropped.
///
/// The file begins with the line "tessera brick log 2" and a line of JSON that says what its bricks were made
/// of. Then come records: six 32-bit words (a mark, depth, x, y, z, bytes packed; little endian), the samples
/// packed by LZ4 (the first bytes of all values, their second ones and so on, values channel by channel; then
/// one byte of coverage a point), and 36 characters of a digest of all that.
class BrickLog : public BrickArchive {
  public:
    /// What the bricks of a log are made of, as its line of JSON. Reads the whole mesh.
    /// @param fields indices into mesh.fields: the channels. @param algorithm and the code path where paths
    /// differ in bits.
    static std::string describe(const TetMesh& mesh, std::span<const int> fields,
                                const std::string& algorithm, const PlanFrame& frame);

    /// Opens a log, or makes one, of bricks of so many cells along an edge and so many channels. Throws
    /// InputError when the file isn't a log or was made of something else, IoError when it can't be used.
    BrickLog(const std::string& path, const std::string& description, int brickCells, int channels);
    ~BrickLog() override;
    BrickLog(const BrickLog&) = delete;
    BrickLog& operator=(const BrickLog&) = delete;

    std::size_t brickCount() const;
    /// Bytes at the end that were dropped when it was opened: no whole brick.
    std::int64_t droppedBytes() const { return droppedBytes_; }

    bool contains(const DepthKey& key) const override;
    std::shared_ptr<const Block> read(const DepthKey& key, const Lattice& lattice,
                                      const IndexBox& box) const override;
    void append(const DepthKey& key, const Block& samples) override;

  private:
    struct Place {
        std::int64_t offset = 0;
        std::int64_t bytes = 0;  ///< of the whole record
    };
    void scan(std::int64_t from);

    std::string path_;
    int channels_;
    std::size_t pointCount_;   ///< of a brick
    std::size_t packedBytes_;  ///< of a brick at most
    int descriptor_ = -1;
    std::int64_t droppedBytes_ = 0;
    mutable std::mutex mutex_;  ///< of all below
    std::int64_t end_ = 0;
    std::unordered_map<DepthKey, Place, DepthKeyHash> places_;
};

}  // namespace tessera
