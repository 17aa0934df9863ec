#include "cache/brick_log.h"

#include <fcntl.h>
#include <lz4.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <climits>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/check.h"
#include "files/file_digest.h"
#include "tessera/error.h"

namespace tessera {

namespace {

static_assert(std::endian::native == std::endian::little);

constexpr char kFirstLine[] = "tessera brick log 2\n";
constexpr std::int32_t kMark = 0x52425354;  // "TSBR"
constexpr std::size_t kDigestBytes = 36;

using Head = std::array<std::int32_t, 6>;  // mark, depth, x, y, z, bytes packed

/// Of a brick's samples unpacked: values and coverage.
std::size_t bytesOf(std::size_t pointCount, int channels) {
    return pointCount * (std::size_t(channels) * sizeof(float) + 1);
}

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
bool isPlausible(const Head& head, std::size_t mostBytes) {
    return head[0] == kMark && head[1] >= 0 && head[1] <= GrowingTree::kDeepest.halvings() && head[5] > 0 &&
           std::size_t(head[5]) <= mostBytes;
}

/// The first bytes of all numbers, then their second ones and so on, as they pack better; or back again.
void shuffle(std::span<const float> values, char* planes) {
    const char* bytes = reinterpret_cast<const char*>(values.data());
    for (std::size_t b = 0; b < sizeof(float); ++b)
        for (std::size_t i = 0; i < values.size(); ++i) *planes++ = bytes[i * sizeof(float) + b];
}
void unshuffle(const char* planes, std::span<float> values) {
    char* bytes = reinterpret_cast<char*>(values.data());
    for (std::size_t b = 0; b < sizeof(float); ++b)
        for (std::size_t i = 0; i < values.size(); ++i) bytes[i * sizeof(float) + b] = *planes++;
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

BrickLog::BrickLog(const std::string& path, const std::string& description, int brickCells, int channels)
    : path_(path), channels_(channels), pointCount_(std::size_t(std::pow(brickCells + 1, 3))) {
    const int most = LZ4_compressBound(int(std::min(bytesOf(pointCount_, channels), std::size_t(INT_MAX))));
    if (most <= 0) throw InputError(path + ": a brick is too large for a log");
    packedBytes_ = std::size_t(most);
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
            throw InputError(
                path +
                ": a log of another mesh, other fields, another lattice, another algorithm or another "
                "version of tessera");
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
        if (readAt(descriptor_, path_, end_, head.data(), sizeof head) < sizeof head ||
            !isPlausible(head, packedBytes_))
            break;
        const std::size_t bytes = sizeof head + std::size_t(head[5]) + kDigestBytes;
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
        return InputError(path_ + ": damaged: the brick at byte " + std::to_string(place.offset));
    };
    if (readAt(descriptor_, path_, place.offset, record.data(), record.size()) < record.size())
        throw damaged();
    if (digestOf(record.data(), record.size() - kDigestBytes) !=
        std::string(record.end() - std::ptrdiff_t(kDigestBytes), record.end()))
        throw damaged();
    auto block = std::make_shared<Block>();
    block->lattice = lattice;
    block->box = box;
    block->channels = channels_;
    TESSERA_CHECK(block->count() == pointCount_, "a brick of another size");
    // The digest tells damage alone: nothing here may be believed.
    std::vector<char> unpacked(bytesOf(pointCount_, channels_));
    const int packed = int(record.size() - sizeof(Head) - kDigestBytes);
    if (LZ4_decompress_safe(record.data() + sizeof(Head), unpacked.data(), packed, int(unpacked.size())) !=
        int(unpacked.size()))
        throw damaged();
    block->values.resize(pointCount_ * std::size_t(channels_));
    unshuffle(unpacked.data(), block->values);
    block->coverage.assign(unpacked.end() - std::ptrdiff_t(pointCount_), unpacked.end());
    if (std::any_of(block->coverage.begin(), block->coverage.end(), [](int covered) { return covered > 1; }))
        throw damaged();
    return block;
}

void BrickLog::append(const DepthKey& key, const Block& samples) {
    if (contains(key)) return;
    TESSERA_CHECK(samples.count() == pointCount_ && samples.channels == channels_, "a brick of another size");
    std::vector<char> raw(bytesOf(pointCount_, channels_));
    shuffle(samples.values, raw.data());
    std::copy(samples.coverage.begin(), samples.coverage.end(), raw.end() - std::ptrdiff_t(pointCount_));
    std::vector<char> record(sizeof(Head) + packedBytes_ + kDigestBytes);
    const int packed =
        LZ4_compress_default(raw.data(), record.data() + sizeof(Head), int(raw.size()), int(packedBytes_));
    TESSERA_CHECK(packed > 0, "LZ4 can't pack a brick");
    const Head head{kMark, key.depth.halvings(), key.index.x, key.index.y, key.index.z, packed};
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
