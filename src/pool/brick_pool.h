#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "gl/gl_handles.h"
#include "gl/gl_thread.h"
#include "gl/shader_text.h"
#include "pool/brick_index.h"
#include "pool/slot_layout.h"
#include "pool/texel_coding.h"

namespace tessera {

/// How large a pool is.
struct PoolOptions {
    /// Of all slots. The index comes on top: 50 bytes at most for every brick that is split, in three copies
    /// and one for each further state that is held.
    std::int64_t budgetBytes = std::int64_t(1) << 30;
    /// Of the slots made at first, one layer of a texture's at least; textures grow as slots are taken. 0:
    /// all are made at once.
    std::int64_t firstBytes = 0;
    /// Texels along an edge are bounded by the device too.
    AtlasLimits limits;
};

/// A whole, consistent state of a pool. While it is held nothing that it refers to is overwritten, so a frame
/// may take as many tasks of the OpenGL thread as it likes. It may outlive the pool, and be dropped on any
/// thread, but not live longer than the OpenGL thread.
struct PoolState {
    /// A buffer with the words of a BrickIndex, whose numbers are slots.
    const GlBuffer* index = nullptr;
    std::int64_t number = 0;  ///< counts the states shown, from 1 on
};

/// GLSL that finds the brick at a place by PoolState::index: findBrick(). Needs BRICK_INDEX_BINDING, the
/// binding of that buffer.
ShaderText brickIndexShader();

/// What goes into a slot.
struct SlotUpload {
    struct Part {
        IndexBox box;  ///< counted from the slot's first texel
        Texels texels;
    };
    std::uint32_t slot = 0;
    /// This slot's texels come first, then those of the parts.
    std::optional<std::uint32_t> copiedFrom;
    std::vector<Part> parts;
};

/// Bricks in the memory of an OpenGL device: slots in 3D textures, each with the (B + 1)^3 samples of a
/// brick's closed box, and an index from the octree to slots in a buffer. A writer takes free slots, fills
/// them and shows them; slots that were shown before come back when no state holds them and the device has
/// done what was asked of it until then. Texels are those of TexelCoding; places those of SlotLayout.
///
/// A texture that grows is another one, with what the one before had: look it up when it is used.
///
/// Its functions may be called on any thread: they are tasks of the OpenGL thread, where they run at once.
class BrickPool {
  public:
    /// Takes the device's memory, or that of the first slots. The thread must outlive the pool. Throws
    /// InputError for a budget that holds no brick, GlError when the device has no room.
    BrickPool(GlThread& thread, int brickCells, TexelCoding coding, const PoolOptions& options = {});

    GlThread& thread() const;
    int brickCells() const { return layout_.edge - 1; }
    const TexelCoding& coding() const { return coding_; }
    const SlotLayout& layout() const { return layout_; }
    /// Slots that there may be: fewer than the budget allows once the device had no memory for more.
    std::size_t capacity() const { return isDeviceFull() ? madeSlots() : layout_.capacity(); }
    bool isDeviceFull() const;
    /// Of textures and buffers as they are now.
    std::int64_t deviceBytes() const;
    /// Made so far. To be used on the OpenGL thread.
    int atlases() const;
    /// Textures of a group in an atlas; not filtered unless a sampler says so. To be used on the OpenGL
    /// thread.
    const GlTexture& codes(int atlas, std::size_t group) const;
    const GlTexture& coverage(int atlas, std::size_t group) const;

    /// What is shown; null before anything is.
    std::shared_ptr<const PoolState> state() const;
    /// Whether a state is held.
    bool isHeld() const;
    /// Slots that nothing refers to by now.
    std::size_t freeSlots();

    /// Takes so many slots, or none when there aren't as many that no state holds; waits for the device
    /// rather than give none. Where the device has no memory for a texture that grows, the pool stays as
    /// large as it is.
    std::optional<std::vector<std::uint32_t>> takeSlots(std::size_t count);
    /// Slots that no state shown refers to, or none that is held nor will be taken.
    void giveBack(std::span<const std::uint32_t> slots);
    /// Throws GlError when the device fails; then the slots' texels are undefined.
    void upload(std::span<const SlotUpload> uploads);
    /// Copies what changed in the index into a buffer and makes it the state shown. Slots retired are those
    /// that the state before refers to and this one doesn't. When it throws, the state shown stays, and the
    /// next call copies what this one left.
    void show(BrickIndex& index, std::span<const std::uint32_t> retired);

  private:
    struct Device;
    void grow(GlContext& context, int layers) const;
    std::size_t madeSlots() const;
    void copySlot(const GlFunctions& gl, std::uint32_t from, std::uint32_t to) const;
    void uploadPart(const GlFunctions& gl, std::uint32_t slot, const SlotUpload::Part& part) const;

    TexelCoding coding_;
    SlotLayout layout_;
    std::shared_ptr<Device> device_;  // ends on the OpenGL thread
};

}  // namespace tessera
