#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tessera/execution.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"
#include "tessera/statistics.h"

namespace tessera {

class DeviceSlots;
class SharedElementIndex;

/// How a resampler keeps a value before it is handed over as a float. The normalised formats divide the
/// field's range into equal steps; they exist on OpenGL targets.
enum class SampleFormat { r32f, r16f, r16, r8 };
/// "r32f", "r16f", "r16", "r8".
std::string_view nameOf(SampleFormat format);

/// How a bound resampler comes to the elements near its boxes. Samples have the same bits by each.
enum class Route {
    /// By the index where the boxes are a small part of the mesh and it is there or pays.
    automatic,
    /// By the element index: costs what the boxes hold.
    index,
    /// By a pass over the whole mesh: needs no index.
    pass,
};

/// Who makes what an OpenGL algorithm draws or scans, from the elements near the points. Samples don't depend
/// on it.
enum class Primitives {
    device,    ///< compute shaders, where the whole mesh can stay on the device
    processor  ///< as Weiler and Ertl balanced it in 2001; uploaded region by region
};
/// "device", "processor".
std::string_view nameOf(Primitives primitives);

/// What BoundResampler runs with.
struct BindOptions {
    /// One of Resampler::targets(); empty: the first.
    std::string target;
    SampleFormat format = SampleFormat::r32f;
    Route route = Route::automatic;
    Primitives primitives = Primitives::device;
    /// Of the mesh that is bound, to share it with others; null: one of its own, built when it pays.
    std::shared_ptr<const SharedElementIndex> index = nullptr;
    /// Bound on WorkMemory, bytes, without its fixed part; less than its least counts as that. 0: its most.
    /// Samples don't depend on it.
    std::int64_t workBytes = 0;
    /// Of an algorithm that draws slice by slice (ResamplerInfo::isSliced): across which axis of the lattice,
    /// 0 to 2; none: the one with the fewest pairs of element and slice. Samples don't depend on it, but
    /// those of methods as they were published. Where they stay on a device it is 2.
    std::optional<int> sliceAxis = std::nullopt;
};

/// What a resampler takes of this machine's memory while it samples, beside the mesh, what is found out about
/// its elements, and the samples; bytes.
struct WorkMemory {
    std::int64_t fixed = 0;  ///< what a driver takes, an emulated device's among them
    std::int64_t least = 0;  ///< with this it works
    std::int64_t most = 0;   ///< more doesn't speed it up
    /// What a byte of samples comes to: between samples lies memory that the work has given back, but that
    /// isn't used again.
    double spread = 1;
};

/// Receives each finished block once: called concurrently from worker threads, in any order; the block lives
/// for the call only.
using BlockSink = std::function<void(std::size_t boxIndex, const Block& block)>;

/// A resampler with a mesh and a choice of fields. The mesh must outlive it and stay unchanged.
class BoundResampler {
  public:
    virtual ~BoundResampler() = default;

    /// The code path in use, one of Resampler::targets().
    virtual std::string_view target() const { return "default"; }

    /// Samples the boxes of one lattice. Boxes may overlap and lie anywhere. The values and coverage of a
    /// lattice point depend on the mesh and that point only: not on the boxes, threads or processor. Costs
    /// what the boxes hold where they are few (BindOptions::route). Several threads may call at once. Throws
    /// InputError for a lattice that can't be used (spacing not positive and finite, indices beyond 2^30) or
    /// a box of more than 2^31 - 1 points.
    virtual ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                        const BlockSink& sink, const Execution& execution) = 0;

    /// resample() into slots on a device, one a box. Algorithms on that device leave their samples there;
    /// others, and those on another target, upload their blocks. Throws InputError besides where the slots
    /// have other channels or, on their own target, another format.
    virtual ResampleStatistics resampleToDevice(const Lattice& lattice, std::span<const IndexBox> boxes,
                                                DeviceSlots& slots, const Execution& execution);
};

/// What an algorithm is and can do.
struct ResamplerInfo {
    /// As on the command line, e.g. "software".
    std::string name;
    /// One line.
    std::string description;
    /// Its targets are graphics devices or drivers, and its samples can stay there.
    bool isOnDevice = false;
    /// It draws the lattice slice by slice.
    bool isSliced = false;
    /// All targets give the same bits. Not so where each is a device of its own.
    bool targetsAgree = true;
    /// Whether it meets the contract in docs/algorithms.md: no holes, no spill, no overshoot, bounded error,
    /// the same bits always. False for methods as they were published, which show what accuracy costs: they
    /// are taken only by name.
    bool meetsContract = true;
    /// Formats it can sample in, the exact one first.
    std::vector<SampleFormat> formats{SampleFormat::r32f};
    /// Largest true distance from the mesh, in voxels, at which a point may be covered (contract clause 2).
    double spillBoundVoxels = 0;
    /// Distance in voxels within which the interpolated place may differ from the lattice point (contract
    /// clause 4).
    double placeBoundVoxels = 0;
};

/// One resampling algorithm.
class Resampler {
  public:
    explicit Resampler(ResamplerInfo info) : info_(std::move(info)) {}
    virtual ~Resampler() = default;
    const ResamplerInfo& info() const { return info_; }
    const std::string& name() const { return info_.name; }
    /// Empty when this machine can run it, else the reason why not.
    virtual std::string unavailableReason() const { return {}; }
    /// Code paths this processor or driver offers, the default first: "AVX3", "AVX2", "SSE4", or
    /// "egl-device", "egl-surfaceless", "osmesa".
    virtual std::vector<std::string> targets() const { return {"default"}; }
    /// The same on every machine.
    virtual WorkMemory workMemory(int channels) const;
    /// @param fields indices into mesh.fields; channels of the blocks are their components, in this order.
    /// Throws InputError for options that it doesn't have.
    virtual std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                                 const BindOptions& options = {}) const = 0;

  private:
    ResamplerInfo info_;
};

/// Convenience for single use: samples one box into one block.
Block resampleBlock(const Resampler& resampler, const TetMesh& mesh, std::span<const int> fields,
                    const Lattice& lattice, const IndexBox& box, const Execution& execution = {});

}  // namespace tessera
