#include "benchmark/peer_resampler.h"

#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/timer.h"
#include "benchmark/quoted_text.h"
#include "files/temporary_folder.h"
#include "mesh_files/write_tets.h"
#include "resample/check_lattice.h"
#include "resample/statistic_names.h"
#include "tessera/error.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "peers write little-endian floats");

constexpr double kPeerBoundVoxels = 0x1p-8;
constexpr double kMostWaste = 2;  // points of a request over those of its boxes

/// What a peer is asked for at once.
struct PeerRequest {
    IndexBox box;
    std::vector<std::size_t> members;  ///< boxes inside it
};

IndexBox boxAround(std::span<const IndexBox> boxes, std::span<const std::size_t> members) {
    IndexBox all = boxes[members[0]];
    for (const std::size_t b : members)
        all = {glm::min(all.min, boxes[b].min), glm::max(all.max, boxes[b].max)};
    return all;
}

double pointsOf(const IndexBox& box) {
    const Vec3d n(box.size());
    return n.x * n.y * n.z;
}

/// Parts boxes in the middle until what is asked for is mostly wanted.
void groupRequests(std::span<const IndexBox> boxes, std::vector<std::size_t> members,
                   std::vector<PeerRequest>& requests) {
    if (members.empty()) return;
    const IndexBox all = boxAround(boxes, members);
    double wanted = 0;
    for (const std::size_t b : members) wanted += pointsOf(boxes[b]);
    const double asked = pointsOf(all);
    if (members.size() == 1 ||
        (asked <= kMostWaste * wanted && asked <= std::numeric_limits<std::int32_t>::max())) {
        requests.push_back({all, std::move(members)});
        return;
    }
    const Vec3i n = all.size();
    const int longest = std::max({n.x, n.y, n.z});
    const int axis = n.z == longest ? 2 : n.y == longest ? 1 : 0;
    const auto middle = members.begin() + std::ptrdiff_t(members.size() / 2);
    std::nth_element(members.begin(), middle, members.end(), [&](std::size_t a, std::size_t b) {
        return std::pair(boxes[a].min[axis], a) < std::pair(boxes[b].min[axis], b);
    });
    std::vector<std::size_t> upper(middle, members.end());
    members.erase(middle, members.end());
    groupRequests(boxes, std::move(members), requests);
    groupRequests(boxes, std::move(upper), requests);
}

/// The mesh as a peer gets it: the chosen fields alone, each with a name of its own.
TetMesh meshOf(const TetMesh& mesh, std::span<const int> fields) {
    TetMesh chosen{mesh.points, mesh.tets, {}};
    for (const int f : fields) {
        Field field = mesh.fields[std::size_t(f)];
        const std::string name = field.name;
        for (int n = 2; chosen.findField(field.name) >= 0; ++n) field.name = name + " " + std::to_string(n);
        chosen.fields.push_back(std::move(field));
    }
    return chosen;
}

nlohmann::ordered_json describeFields(const TetMesh& mesh) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const Field& field : mesh.fields)
        list.push_back({{"name", field.name},
                        {"location", field.location == FieldLocation::point ? "point" : "cell"},
                        {"components", field.components}});
    return list;
}

/// Samples of one request, as the peer wrote them: field by field, the components of a point side by side.
struct PeerSamples {
    IndexBox box;
    std::vector<float> values;
};

/// Copies a row of points along x. @param from a point's first component, of the row's first point.
void copyRow(const float* from, int components, std::size_t length, float* to, std::size_t channelStep,
             std::uint8_t* coverage) {
    for (std::size_t i = 0; i < length; ++i)
        for (int c = 0; c < components; ++c) {
            const float value = from[i * std::size_t(components) + std::size_t(c)];
            to[std::size_t(c) * channelStep + i] = value;
            if (!std::isfinite(value)) coverage[i] = 0;
        }
}

class BoundPeer : public BoundResampler {
  public:
    BoundPeer(const PeerCommand& peer, const TetMesh& mesh, std::span<const int> fields)
        : folder_("tessera-peer-"), samplesPath_(folder_.pathOf("samples.raw")) {
        const TetMesh chosen = meshOf(mesh, fields);
        fields_ = describeFields(chosen);
        for (const Field& field : chosen.fields) components_.push_back(field.components);
        for (const int components : components_) channels_ += components;
        const std::string meshPath = folder_.pathOf("mesh.vtu");
        writeTets(chosen, meshPath, {});
        process_.emplace(peer, meshPath, folder_.pathOf("stderr.txt"));
        name_ = peer.name;
    }

    std::string_view target() const override { return process_->title(); }

    ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                const BlockSink& sink, const Execution& execution) override {
        checkLattice(lattice, boxes);
        if (!lattice.isAxisParallel())
            throw InputError("the peer " + name_ +
                             " samples lattices along x, y and z only, not turned ones");
        const std::lock_guard lock(mutex_);
        const Timer timer;
        std::vector<PeerRequest> requests;
        std::vector<std::size_t> members;
        for (std::size_t b = 0; b < boxes.size(); ++b) {
            if (!boxes[b].empty())
                members.push_back(b);
            else
                sink(b, emptyBlock(lattice, boxes[b]));
        }
        groupRequests(boxes, std::move(members), requests);
        double sampleMs = 0;
        for (const PeerRequest& request : requests)
            sampleMs += sample(lattice, boxes, request, sink, execution);
        ResampleStatistics statistics;
        statistics.add(kPeerRequests, std::int64_t(requests.size()));
        statistics.addMs(stage::sample, sampleMs);
        statistics.addMs(kTransferStage, std::max(0.0, timer.elapsedMs() - sampleMs));
        return statistics;
    }

  private:
    Block emptyBlock(const Lattice& lattice, const IndexBox& box) const {
        Block block;
        block.lattice = lattice;
        block.box = box;
        block.channels = channels_;
        return block;
    }

    /// Returns the milliseconds of the sampling.
    double sample(const Lattice& lattice, std::span<const IndexBox> boxes, const PeerRequest& request,
                  const BlockSink& sink, const Execution& execution) {
        const Vec3d origin = lattice.worldFromIndex(Vec3d(request.box.min));
        const Vec3i n = request.box.size();
        const nlohmann::ordered_json line{{"fields", fields_},
                                          {"origin", {origin.x, origin.y, origin.z}},
                                          {"spacing", {lattice.uWorld.x, lattice.vWorld.y, lattice.wWorld.z}},
                                          {"points", {n.x, n.y, n.z}},
                                          {"threads", execution.threadCount()},
                                          {"samples", samplesPath_}};
        // A request that failed may have left something.
        std::error_code ignored;
        fs::remove(samplesPath_, ignored);
        const double ms = process_->ask(line, execution);
        const PeerSamples samples{request.box, readSamples(std::size_t(request.box.count()))};
        parallelFor(execution, std::int64_t(request.members.size()), [&](std::int64_t m) {
            const std::size_t b = request.members[std::size_t(m)];
            sink(b, cut(samples, lattice, boxes[b]));
        });
        return ms;
    }

    /// Takes the file of samples away.
    std::vector<float> readSamples(std::size_t points) {
        std::vector<float> values(points * std::size_t(channels_));
        const std::size_t bytes = values.size() * sizeof(float);
        const std::string expected = std::to_string(bytes) + " bytes of samples, 4 for each of " +
                                     std::to_string(channels_) + " channels at " + std::to_string(points) +
                                     " points";
        std::error_code error;
        if (!fs::is_regular_file(samplesPath_, error)) process_->fail(expected, "it wrote no file");
        const std::uintmax_t size = fs::file_size(samplesPath_, error);
        if (error || size != bytes)
            process_->fail(expected, "it wrote " + (error ? error.message() : std::to_string(size)));
        std::ifstream file(samplesPath_, std::ios::binary);
        if (!file.read(reinterpret_cast<char*>(values.data()), std::streamsize(bytes)))
            process_->fail(expected, "its file can't be read");
        fs::remove(samplesPath_, error);
        return values;
    }

    Block cut(const PeerSamples& samples, const Lattice& lattice, const IndexBox& box) const {
        Block block = emptyBlock(lattice, box);
        const std::size_t count = block.count();
        block.values.resize(count * std::size_t(channels_));
        block.coverage.assign(count, 1);
        const Vec3i n = samples.box.size();
        const auto points = std::size_t(samples.box.count()), length = std::size_t(box.size().x);
        Vec3i p = box.min;
        for (p.z = box.min.z; p.z < box.max.z; ++p.z)
            for (p.y = box.min.y; p.y < box.max.y; ++p.y) {
                const Vec3i q = p - samples.box.min;
                const std::size_t to = block.offset(p);
                const std::size_t from =
                    (std::size_t(q.z) * std::size_t(n.y) + std::size_t(q.y)) * std::size_t(n.x) +
                    std::size_t(q.x);
                std::size_t channel = 0;
                for (const int components : components_) {
                    const float* const field = samples.values.data() + channel * points;
                    copyRow(field + from * std::size_t(components), components, length,
                            block.values.data() + channel * count + to, count, block.coverage.data() + to);
                    channel += std::size_t(components);
                }
            }
        // Where nothing is covered other algorithms leave zeros.
        for (std::size_t at = 0; at < count; ++at)
            for (std::size_t c = 0; !block.coverage[at] && c < std::size_t(channels_); ++c)
                block.values[c * count + at] = 0;
        return block;
    }

    std::mutex mutex_;
    TemporaryFolder folder_;  ///< outlives the process
    std::string samplesPath_, name_;
    nlohmann::ordered_json fields_;
    std::vector<int> components_;
    int channels_ = 0;
    std::optional<PeerProcess> process_;
};

class PeerResampler : public Resampler {
  public:
    explicit PeerResampler(PeerCommand peer)
        : Resampler({.name = peer.name,
                     .description = "another program: " + peer.command,
                     .meetsContract = false,
                     .spillBoundVoxels = kPeerBoundVoxels,
                     .placeBoundVoxels = kPeerBoundVoxels}),
          peer_(std::move(peer)) {}

    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions& options) const override {
        if (options.format != SampleFormat::r32f)
            throw InputError("the peer " + name() + " samples in r32f only, not in " +
                             std::string(nameOf(options.format)));
        if (!options.target.empty() && options.target != targets().front())
            throw InputError("the peer " + name() + " has no target named " + options.target);
        if (fields.empty()) throw InputError("the peer " + name() + " needs a field to sample");
        const std::lock_guard lock(mutex_);
        if (!failure_.empty()) throw IoError(failure_);
        try {
            return std::make_unique<BoundPeer>(peer_, mesh, fields);
        } catch (const IoError& error) {
            failure_ = error.what();  // one that doesn't start won't the next time
            throw;
        }
    }

  private:
    PeerCommand peer_;
    mutable std::mutex mutex_;
    mutable std::string failure_;
};

}  // namespace

std::unique_ptr<const Resampler> makePeer(PeerCommand peer) {
    return std::make_unique<PeerResampler>(std::move(peer));
}

std::optional<PeerCommand> vtkPeer(const std::string& programFolder) {
    const std::string program = (fs::path(programFolder) / "tessera-vtk-peer").string();
    if (::access(program.c_str(), X_OK) != 0) return std::nullopt;
    return PeerCommand{"VTK", shellWord(program)};
}

}  // namespace tessera
