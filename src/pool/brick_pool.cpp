#include "pool/brick_pool.h"

#include <algorithm>
#include <string>
#include <utility>

#include "pool/shaders.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Copies of the index that stand beside the one shown before one waits for the device.
constexpr std::size_t kSpareCopies = 2;

/// One copy of the index in device memory: the state shown, one that frames hold, or a spare.
struct IndexCopy {
    GlBuffer buffer;
    std::vector<bool> isStale;  // by run of words: the buffer has other ones
    PoolState state;
    int holders = 0;
    GlFence released;  // after the last use

    bool isIdle() {
        if (holders > 0) return false;
        if (released && released.isSignaled()) released.reset();
        return !released;
    }
};

struct RetiredSlot {
    std::uint32_t slot;
    std::int64_t lastState;  // that refers to it
};

}  // namespace

// All that OpenGL has; only its thread looks at it.
struct BrickPool::Device {
    GlThread* thread = nullptr;
    GlContext* context = nullptr;
    std::vector<GlTexture> codes, coverage;  // atlas by atlas, group by group
    std::vector<std::unique_ptr<IndexCopy>> copies;
    IndexCopy* shown = nullptr;
    std::vector<std::uint32_t> freeSlots;
    std::vector<RetiredSlot> retired;

    std::int64_t indexBytes() const;
    void release(IndexCopy& copy) noexcept;
    void freeRetired();
    bool waitForOne();
    IndexCopy& spareCopy();
    void write(IndexCopy& copy, std::span<const std::uint32_t> words);
};

std::int64_t BrickPool::Device::indexBytes() const {
    std::int64_t bytes = 0;
    for (const auto& copy : copies) bytes += copy->buffer.bytes();
    return bytes;
}

// A holder has gone: what it asked of the device is done when the fence signals.
void BrickPool::Device::release(IndexCopy& copy) noexcept {
    if (--copy.holders == 0) copy.released = GlFence(*context);
}

void BrickPool::Device::freeRetired() {
    std::int64_t oldestUsed = shown ? shown->state.number : 0;
    for (const auto& copy : copies)
        if (copy.get() != shown && !copy->isIdle()) oldestUsed = std::min(oldestUsed, copy->state.number);
    std::erase_if(retired, [&](const RetiredSlot& slot) {
        if (slot.lastState >= oldestUsed) return false;
        freeSlots.push_back(slot.slot);
        return true;
    });
}

// Waits for the device to end with a copy that no frame holds; false when there is none.
bool BrickPool::Device::waitForOne() {
    IndexCopy* oldest = nullptr;
    for (const auto& copy : copies)
        if (copy.get() != shown && copy->holders == 0 && copy->released &&
            (!oldest || copy->state.number < oldest->state.number))
            oldest = copy.get();
    if (!oldest) return false;
    oldest->released.wait();
    oldest->released.reset();
    return true;
}

IndexCopy& BrickPool::Device::spareCopy() {
    for (;;) {
        for (const auto& copy : copies)
            if (copy.get() != shown && copy->isIdle()) return *copy;
        if (copies.size() <= kSpareCopies || !waitForOne()) break;
    }
    return *copies.emplace_back(std::make_unique<IndexCopy>());
}

void BrickPool::Device::write(IndexCopy& copy, std::span<const std::uint32_t> words) {
    const auto bytes = std::int64_t(words.size_bytes());
    if (bytes > copy.buffer.bytes()) {
        if (bytes > context->info().limits.storageBlockBytes)
            throw GlError("an index of " + std::to_string(bytes) +
                          " bytes is larger than the device's storage blocks, " +
                          std::to_string(context->info().limits.storageBlockBytes) + " bytes");
        copy.buffer = GlBuffer(*context, bytes + bytes / 2, GL_DYNAMIC_STORAGE_BIT);
        copy.isStale.assign(copy.isStale.size(), true);
    }
    const GlFunctions& gl = context->functions();
    for (std::size_t run = 0; run < copy.isStale.size(); ++run) {
        if (!copy.isStale[run]) continue;
        std::size_t end = run;
        while (end < copy.isStale.size() && copy.isStale[end]) copy.isStale[end++] = false;
        const std::size_t first = run * BrickIndex::kRunWords;
        const std::size_t last = std::min(words.size(), end * BrickIndex::kRunWords);
        run = end;
        if (first >= last) break;
        gl.NamedBufferSubData(copy.buffer.id(), GLintptr(first * sizeof(std::uint32_t)),
                              GLsizeiptr((last - first) * sizeof(std::uint32_t)), &words[first]);
    }
}

BrickPool::BrickPool(GlThread& thread, int brickCells, TexelCoding coding, const PoolOptions& options)
    : coding_(std::move(coding)) {
    AtlasLimits limits = options.limits;
    limits.texels = std::min(limits.texels, thread.info().limits.texture3dSize);
    std::int64_t largest = 1;
    for (std::size_t group = 0; group < coding_.groupCount(); ++group)
        largest = std::max(largest, coding_.texelBytes(group));
    layout_ = chooseSlotLayout(brickCells + 1, coding_.pointBytes(), largest, options.budgetBytes, limits);
    device_ = std::shared_ptr<Device>(new Device, [&thread](Device* d) {
        if (thread.isThisThread())
            delete d;
        else
            thread.run([d](GlContext&) { delete d; });
    });
    device_->thread = &thread;
    thread.run([&](GlContext& context) {
        device_->context = &context;
        const Vec3i texels = layout_.texels();
        for (int atlas = 0; atlas < layout_.atlases; ++atlas)
            for (std::size_t group = 0; group < coding_.groupCount(); ++group) {
                device_->codes.emplace_back(context, GL_TEXTURE_3D, coding_.internalFormat(group), texels.x,
                                            texels.y, texels.z);
                device_->coverage.emplace_back(context, GL_TEXTURE_3D, GL_R8, texels.x, texels.y, texels.z);
            }
    });
    // The lowest are taken first.
    for (std::size_t slot = capacity(); slot-- > 0;) device_->freeSlots.push_back(std::uint32_t(slot));
}

GlThread& BrickPool::thread() const {
    return *device_->thread;
}

std::int64_t BrickPool::deviceBytes() const {
    const Vec3i texels = layout_.texels();
    const std::int64_t points = std::int64_t(texels.x) * texels.y * texels.z * layout_.atlases;
    return points * coding_.pointBytes() + thread().run([&](GlContext&) { return device_->indexBytes(); });
}

const GlTexture& BrickPool::codes(int atlas, std::size_t group) const {
    return device_->codes[std::size_t(atlas) * coding_.groupCount() + group];
}

const GlTexture& BrickPool::coverage(int atlas, std::size_t group) const {
    return device_->coverage[std::size_t(atlas) * coding_.groupCount() + group];
}

std::shared_ptr<const PoolState> BrickPool::state() const {
    return thread().run([&](GlContext&) -> std::shared_ptr<const PoolState> {
        IndexCopy* copy = device_->shown;
        if (!copy) return nullptr;
        ++copy->holders;
        return {
            &copy->state, [device = device_, copy](const PoolState*) mutable {
                GlThread& thread = *device->thread;
                if (thread.isThisThread())
                    device->release(*copy);
                else
                    thread.post([device = std::move(device), copy](GlContext&) { device->release(*copy); });
            }};
    });
}

bool BrickPool::isHeld() const {
    return thread().run([&](GlContext&) {
        return std::any_of(device_->copies.begin(), device_->copies.end(),
                           [](const auto& copy) { return copy->holders > 0; });
    });
}

ShaderText brickIndexShader() {
    return shaders::pool::kBrickIndex;
}

std::size_t BrickPool::freeSlots() {
    return thread().run([&](GlContext&) {
        device_->freeRetired();
        return device_->freeSlots.size();
    });
}

std::optional<std::vector<std::uint32_t>> BrickPool::takeSlots(std::size_t count) {
    return thread().run([&](GlContext&) -> std::optional<std::vector<std::uint32_t>> {
        std::vector<std::uint32_t>& free = device_->freeSlots;
        if (free.size() < count) device_->freeRetired();
        while (free.size() < count && device_->waitForOne()) device_->freeRetired();
        if (free.size() < count) return std::nullopt;
        std::vector<std::uint32_t> slots(free.rbegin(), free.rbegin() + std::ptrdiff_t(count));
        free.resize(free.size() - count);
        return slots;
    });
}

void BrickPool::giveBack(std::span<const std::uint32_t> slots) {
    thread().run(
        [&](GlContext&) { device_->freeSlots.insert(device_->freeSlots.end(), slots.begin(), slots.end()); });
}

void BrickPool::upload(std::span<const SlotUpload> uploads) {
    thread().run([&](GlContext& context) {
        context.functions().PixelStorei(GL_UNPACK_ALIGNMENT, 1);
        for (const SlotUpload& upload : uploads) {
            if (upload.copiedFrom) copySlot(context.functions(), *upload.copiedFrom, upload.slot);
            for (const SlotUpload::Part& part : upload.parts)
                uploadPart(context.functions(), upload.slot, part);
        }
    });
}

void BrickPool::copySlot(const GlFunctions& gl, std::uint32_t from, std::uint32_t to) const {
    const Vec3i there = layout_.firstTexel(from), here = layout_.firstTexel(to);
    const int edge = layout_.edge;
    const auto copy = [&](const GlTexture& source, const GlTexture& destination) {
        gl.CopyImageSubData(source.id(), GL_TEXTURE_3D, 0, there.x, there.y, there.z, destination.id(),
                            GL_TEXTURE_3D, 0, here.x, here.y, here.z, edge, edge, edge);
    };
    for (std::size_t group = 0; group < coding_.groupCount(); ++group) {
        copy(codes(layout_.atlasOf(from), group), codes(layout_.atlasOf(to), group));
        copy(coverage(layout_.atlasOf(from), group), coverage(layout_.atlasOf(to), group));
    }
}

void BrickPool::uploadPart(const GlFunctions& gl, std::uint32_t slot, const SlotUpload::Part& part) const {
    const int atlas = layout_.atlasOf(slot);
    const Vec3i at = layout_.firstTexel(slot) + part.box.min, size = part.box.size();
    for (std::size_t group = 0; group < coding_.groupCount(); ++group) {
        gl.TextureSubImage3D(codes(atlas, group).id(), 0, at.x, at.y, at.z, size.x, size.y, size.z,
                             coding_.pixelFormat(group), coding_.pixelType(),
                             part.texels.codes[group].data());
        gl.TextureSubImage3D(coverage(atlas, group).id(), 0, at.x, at.y, at.z, size.x, size.y, size.z, GL_RED,
                             GL_UNSIGNED_BYTE, part.texels.coverage[group].data());
    }
}

void BrickPool::show(BrickIndex& index, std::span<const std::uint32_t> retired) {
    thread().run([&](GlContext& context) {
        IndexCopy& copy = device_->spareCopy();
        const std::size_t runs = index.words().size() / BrickIndex::kRunWords + 1;
        const std::vector<std::uint32_t> changed = index.takeChangedRuns();
        for (const auto& each : device_->copies) {
            if (each->isStale.size() < runs) each->isStale.resize(runs, true);
            for (const std::uint32_t run : changed) each->isStale[run] = true;
        }
        try {
            device_->write(copy, index.words());
            context.throwIfFailed();
        } catch (...) {
            copy.isStale.assign(runs, true);
            throw;
        }
        device_->retired.reserve(device_->retired.size() + retired.size());
        const std::int64_t before = device_->shown ? device_->shown->state.number : 0;
        for (const std::uint32_t slot : retired) device_->retired.push_back({slot, before});
        copy.state = {&copy.buffer, before + 1};
        device_->shown = &copy;
    });
}

}  // namespace tessera
