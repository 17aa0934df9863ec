#include "cache/brick_log.h"

#include <blosc.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/check.h"
#include "files/file_digest.h"
#include "tessera/error.h"

namespace tessera {

namespace {

static_assert(std::endian::native == std::endian::little);

constexpr char kFirstLine[] = "tessera brick log 1\n";
constexpr std::int32_t kMark = 0x52425354;  // "TSBR"
constexpr std::size_t kDigestBytes = 36;
/// More than any brick has: 65^3 points of hundreds of channels.
constexpr std::int32_t kMostBytes = 1 << 30;

using Head = std::array<std::int32_t, 7>;  // mark, depth, x, y, z, bytes unpacked, bytes packed

std::string reason() {
    return std::strerror(errno);
}

std::string digestOf(const void* bytes, std::size_t count) {
    FileDigest digest;
    digest.update(bytes, count);
    return digest.uuid();
}

template <class Item>
void include(FileDigest& digest, const std::vector<Item>& items) {
    const std::uint64_t count = items.size();
    digest.update(&count, sizeof count);
    digest.update(items.data(), items.size() * sizeof(Item));
}

/// How many bytes there were to read.
std::size_t readAt(int descriptor, const std::string& path, std::int64_t offset, void* bytes,
                   std::size_t count) {
    std::size_t done = 0;
    while (done < count) {
        const ssize_t got =
            ::pread(descriptor, static_cast<char*>(bytes) + done, count - done, offset + std::int64_t(done));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) throw IoError(path + ": can't be read: " + reason());
        if (got == 0) break;
        done += std::size_t(got);
    }
    return done;
}

void writeAt(int descriptor, const std::string& path, std::int64_t offset, const void* bytes,
             std::size_t count) {
    std::size_t done = 0;
    while (done < count) {
        const ssize_t put = ::pwrite(descriptor, static_cast<const char*>(bytes) + done, count - done,
                                     offset + std::int64_t(done));
        if (put < 0 && errno == EINTR) continue;
        if (put < 0) throw IoError(path + ": can't be written: " + reason());
        done += std::size_t(put);
    }
}

/// Of a record whose head was read: false for one that no log has.
bool isPlausible(const Head& head) {
    return head[0] == kMark && head[1] >= 0 && head[1] <= GrowingTree::kDeepest.halvings() && head[5] > 0 &&
           head[5] <= kMostBytes && head[6] > 0 && head[6] <= kMostBytes;
}

}  // namespace

std::string BrickLog::describe(const TetMesh& mesh, std::span<const int> fields, const std::string& algorithm,
                               const PlanFrame& frame) {
    FileDigest digest;
    include(digest, mesh.points);
    include(digest, mesh.tets);
    nlohmann::ordered_json names = nlohmann::ordered_json::array();
    for (const int f : fields) {
        const Field& field = mesh.fields.at(std::size_t(f));
        include(digest, field.values);
        digest.update(&field.location, sizeof field.location);
        names.push_back({{"name", field.name}, {"components", field.components}});
    }
    const Vec3d& origin = frame.originWorld;
    return nlohmann::ordered_json{{"mesh", digest.uuid()},
                                  {"fields", names},
                                  {"algorithm", algorithm},
                                  {"origin", {origin.x, origin.y, origin.z}},
                                  {"coarsest_spacing", frame.rootSpacingWorld},
                                  {"brick_cells", frame.brickCells}}
        .dump();
}

BrickLog::BrickLog(const std::string& path, const std::string& description) : path_(path) {
    descriptor_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (descriptor_ < 0) throw IoError(path + ": can't be opened: " + reason());
    try {
        struct stat status {};
        if (::fstat(descriptor_, &status) != 0) throw IoError(path + ": can't be looked at: " + reason());
        if (!S_ISREG(status.st_mode)) throw InputError(path + ": not a regular file");
        if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0)
            throw IoError(path + ": another program is using this log");
        const std::string head = kFirstLine + description + "\n";
        if (status.st_size == 0) {
            writeAt(descriptor_, path_, 0, head.data(), head.size());
            end_ = std::int64_t(head.size());
            return;
        }
        std::string there(head.size(), '\0');
        there.resize(readAt(descriptor_, path_, 0, there.data(), there.size()));
        if (!there.starts_with(kFirstLine)) throw InputError(path + ": no log of bricks");
        if (there != head)
            throw InputError(path +
                             ": a log of another mesh, other fields, another lattice or another algorithm");
        scan(std::int64_t(head.size()));
    } catch (...) {
        ::close(descriptor_);
        throw;
    }
}

BrickLog::~BrickLog() {
    ::close(descriptor_);
}

// Finds the bricks there are, and cuts off what is behind the last whole one.
void BrickLog::scan(std::int64_t from) {
    struct stat status {};
    if (::fstat(descriptor_, &status) != 0) throw IoError(path_ + ": can't be looked at: " + reason());
    end_ = from;
    std::vector<char> record;
    while (true) {
        Head head{};
        if (readAt(descriptor_, path_, end_, head.data(), sizeof head) < sizeof head || !isPlausible(head))
            break;
        const std::size_t bytes = sizeof head + std::size_t(head[6]) + kDigestBytes;
        if (end_ + std::int64_t(bytes) > status.st_size) break;
        record.resize(bytes);
        if (readAt(descriptor_, path_, end_, record.data(), bytes) < bytes) break;
        if (digestOf(record.data(), bytes - kDigestBytes) !=
            std::string(record.end() - std::ptrdiff_t(kDigestBytes), record.end()))
            break;
        places_[{Depth(head[1]), {head[2], head[3], head[4]}}] = {end_, std::int64_t(bytes)};
        end_ += std::int64_t(bytes);
    }
    droppedBytes_ = status.st_size - end_;
    if (droppedBytes_ > 0 && ::ftruncate(descriptor_, end_) != 0)
        throw IoError(path_ + ": can't be written: " + reason());
}

std::size_t BrickLog::brickCount() const {
    const std::lock_guard lock(mutex_);
    return places_.size();
}

bool BrickLog::contains(const DepthKey& key) const {
    const std::lock_guard lock(mutex_);
    return places_.contains(key);
}

std::shared_ptr<const Block> BrickLog::read(const DepthKey& key, const Lattice& lattice,
                                            const IndexBox& box) const {
    Place place;
    {
        const std::lock_guard lock(mutex_);
        place = places_.at(key);
    }
    std::vector<char> record(std::size_t(place.bytes));
    const auto damaged = [&] {
        return IoError(path_ + ": damaged: the brick at byte " + std::to_string(place.offset));
    };
    if (readAt(descriptor_, path_, place.offset, record.data(), record.size()) < record.size())
        throw damaged();
    if (digestOf(record.data(), record.size() - kDigestBytes) !=
        std::string(record.end() - std::ptrdiff_t(kDigestBytes), record.end()))
        throw damaged();
    Head head{};
    std::memcpy(head.data(), record.data(), sizeof head);
    auto block = std::make_shared<Block>();
    block->lattice = lattice;
    block->box = box;
    const std::size_t count = block->count(), raw = std::size_t(head[5]);
    if (raw < count || (raw - count) % (count * sizeof(float)) != 0) throw damaged();
    block->channels = int((raw - count) / (count * sizeof(float)));
    std::vector<char> unpacked(raw);
    if (blosc_decompress_ctx(record.data() + sizeof head, unpacked.data(), raw, 1) != head[5])
        throw damaged();
    block->values.resize((raw - count) / sizeof(float));
    block->coverage.resize(count);
    std::memcpy(block->values.data(), unpacked.data(), raw - count);
    std::memcpy(block->coverage.data(), unpacked.data() + (raw - count), count);
    return block;
}

void BrickLog::append(const DepthKey& key, const Block& samples) {
    if (contains(key)) return;
    const std::size_t valueBytes = samples.values.size() * sizeof(float);
    std::vector<char> raw(valueBytes + samples.coverage.size());
    TESSERA_CHECK(raw.size() <= std::size_t(kMostBytes), "a brick is too large for a log");
    std::memcpy(raw.data(), samples.values.data(), valueBytes);
    std::memcpy(raw.data() + valueBytes, samples.coverage.data(), samples.coverage.size());
    std::vector<char> record(sizeof(Head) + raw.size() + BLOSC_MAX_OVERHEAD + kDigestBytes);
    constexpr int kLevel = 5;
    const int packed =
        blosc_compress_ctx(kLevel, BLOSC_SHUFFLE, sizeof(float), raw.size(), raw.data(),
                           record.data() + sizeof(Head), raw.size() + BLOSC_MAX_OVERHEAD, "lz4", 0, 1);
    TESSERA_CHECK(packed > 0, "Blosc can't pack a brick");
    const Head head{kMark,       key.depth.halvings(),     key.index.x, key.index.y,
                    key.index.z, std::int32_t(raw.size()), packed};
    std::memcpy(record.data(), head.data(), sizeof head);
    const std::size_t bytes = sizeof head + std::size_t(packed);
    const std::string digest = digestOf(record.data(), bytes);
    std::memcpy(record.data() + bytes, digest.data(), kDigestBytes);
    record.resize(bytes + kDigestBytes);
    const std::lock_guard lock(mutex_);
    writeAt(descriptor_, path_, end_, record.data(), record.size());
    places_[key] = {end_, std::int64_t(record.size())};
    end_ += std::int64_t(record.size());
}

}  // namespace tessera
