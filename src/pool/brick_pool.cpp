#include "pool/brick_pool.h"

#include <algorithm>
#include <atomic>
#include <iterator>
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
    int layers = 0;                          // of slots along z, those of the last atlas
    std::atomic<bool> isFull = false;        // it stays as large as it is; any thread may look
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
    device_ = std::shared_ptr<Device>(new Device, [&thread](Device* device) { thread.dispose(device); });
    device_->thread = &thread;
    const std::int64_t slotTexels = std::int64_t(layout_.edge) * layout_.edge * layout_.edge;
    const std::int64_t layerBytes = slotTexels * layout_.slots.x * layout_.slots.y * coding_.pointBytes();
    const std::int64_t all = std::int64_t(layout_.slots.z) * layout_.atlases;
    const std::int64_t first =
        options.firstBytes > 0 ? std::clamp<std::int64_t>(options.firstBytes / layerBytes, 1, all) : all;
    thread.run([&](GlContext& context) {
        device_->context = &context;
        for (std::int64_t left = first; left > 0; left -= layout_.slots.z)
            grow(context, int(std::min<std::int64_t>(left, layout_.slots.z)));
    });
}

/// Makes the last atlas so many layers deep, or where it is that deep a new one.
void BrickPool::grow(GlContext& context, int layers) const {
    const std::size_t groups = coding_.groupCount();
    const bool isNew = device_->codes.empty() || device_->layers == layout_.slots.z;
    const int before = isNew ? 0 : device_->layers;
    const Vec3i texels = layout_.texels(), kept(texels.x, texels.y, before * layout_.edge);
    std::vector<GlTexture> codes, coverage;
    const auto make = [&](std::vector<GlTexture>& to, GLenum format, const GlTexture* from) {
        to.emplace_back(context, GL_TEXTURE_3D, format, texels.x, texels.y, layers * layout_.edge);
        if (from)
            context.functions().CopyImageSubData(from->id(), GL_TEXTURE_3D, 0, 0, 0, 0, to.back().id(),
                                                 GL_TEXTURE_3D, 0, 0, 0, 0, kept.x, kept.y, kept.z);
    };
    const std::size_t first = isNew ? device_->codes.size() : device_->codes.size() - groups;
    for (std::size_t group = 0; group < groups; ++group) {
        make(codes, coding_.internalFormat(group), isNew ? nullptr : &device_->codes[first + group]);
        make(coverage, GL_RG8, isNew ? nullptr : &device_->coverage[first + group]);
    }
    context.throwIfFailed();
    device_->codes.resize(first);
    device_->coverage.resize(first);
    std::move(codes.begin(), codes.end(), std::back_inserter(device_->codes));
    std::move(coverage.begin(), coverage.end(), std::back_inserter(device_->coverage));
    device_->layers = layers;
    // The lowest are taken first.
    const std::uint32_t atlas = std::uint32_t(first / groups) * layout_.slotsAnAtlas();
    const auto layer = std::uint32_t(layout_.slots.x * layout_.slots.y);
    std::vector<std::uint32_t> slots;
    for (std::uint32_t slot = std::uint32_t(layers) * layer; slot-- > std::uint32_t(before) * layer;)
        slots.push_back(atlas + slot);
    device_->freeSlots.insert(device_->freeSlots.begin(), slots.begin(), slots.end());
}

GlThread& BrickPool::thread() const {
    return *device_->thread;
}

std::int64_t BrickPool::deviceBytes() const {
    return thread().run([&](GlContext&) {
        const std::int64_t slotTexels = std::int64_t(layout_.edge) * layout_.edge * layout_.edge;
        return std::int64_t(madeSlots()) * slotTexels * coding_.pointBytes() + device_->indexBytes();
    });
}

bool BrickPool::isDeviceFull() const {
    return device_->isFull;
}

int BrickPool::atlases() const {
    return int(device_->codes.size() / coding_.groupCount());
}

std::size_t BrickPool::madeSlots() const {
    const auto layer = std::size_t(layout_.slots.x * layout_.slots.y);
    return std::size_t(atlases() - 1) * layout_.slotsAnAtlas() + std::size_t(device_->layers) * layer;
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
        return device_->freeSlots.size() + capacity() - madeSlots();
    });
}

std::optional<std::vector<std::uint32_t>> BrickPool::takeSlots(std::size_t count) {
    return thread().run([&](GlContext& context) -> std::optional<std::vector<std::uint32_t>> {
        std::vector<std::uint32_t>& free = device_->freeSlots;
        if (free.size() < count) device_->freeRetired();
        // By half, so that copying what there is stays cheap for each slot.
        while (free.size() < count && madeSlots() < capacity()) {
            const int layers = device_->layers % layout_.slots.z;
            try {
                grow(context, std::min(layout_.slots.z, layers + std::max(1, layers / 2)));
            } catch (const GlMemoryError&) {
                device_->isFull = true;
            }
        }
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
        gl.TextureSubImage3D(coverage(atlas, group).id(), 0, at.x, at.y, at.z, size.x, size.y, size.z, GL_RG,
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
