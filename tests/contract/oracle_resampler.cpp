#include "oracle_resampler.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "reference/reference_block.h"
#include "tessera/error.h"
#include "tessera/lattice.h"

namespace tessera::contract {

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

float valueOf(const Oracle& oracle, const Field& field, int component, std::int32_t element,
              const ExactWeights& weights) {
    if (field.location == FieldLocation::cell) return float(field.at(element, component));
    float low = std::numeric_limits<float>::infinity(), high = -low;
    for (const std::int32_t n : oracle.mesh().tets[std::size_t(element)]) {
        const auto f = float(field.at(n, component));
        if (!std::isfinite(f)) return kNaN;
        low = std::min(low, f), high = std::max(high, f);
    }
    return std::clamp(float(oracle.interpolate(field, component, element, weights).get_d()), low, high);
}

class BoundOracle : public BoundResampler {
  public:
    BoundOracle(const TetMesh& mesh, std::span<const int> fields)
        : mesh_(&mesh), fields_(fields.begin(), fields.end()) {}

    ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                const BlockSink& sink, const Execution& execution) override {
        const Oracle oracle(*mesh_, lattice);
        parallelFor(execution, std::int64_t(boxes.size()), [&](std::int64_t b) {
            const ReferenceBlock reference =
                referenceBlock(oracle, boxes[std::size_t(b)], {.toleranceVoxels = 0}, {.threads = 1});
            sink(std::size_t(b), fill(oracle, reference));
        });
        return {};
    }

  private:
    Block fill(const Oracle& oracle, const ReferenceBlock& reference) const {
        Block block;
        block.lattice = oracle.lattice();
        block.box = reference.box;
        for (const int f : fields_) block.channels += mesh_->fields[std::size_t(f)].components;
        block.coverage = reference.mustCover;
        block.values.assign(block.count() * std::size_t(block.channels), 0);
        Vec3i p;
        for (p.z = block.box.min.z; p.z < block.box.max.z; ++p.z)
            for (p.y = block.box.min.y; p.y < block.box.max.y; ++p.y)
                for (p.x = block.box.min.x; p.x < block.box.max.x; ++p.x)
                    if (block.covered(p)) fillPoint(oracle, reference, p, block);
        return block;
    }

    void fillPoint(const Oracle& oracle, const ReferenceBlock& reference, const Vec3i& p,
                   Block& block) const {
        const std::size_t offset = block.offset(p);
        Candidate owner;
        owner.depthVoxels = -1;
        for (const Candidate& c : reference.candidatesOf(offset))
            if (c.contains && c.depthVoxels > owner.depthVoxels) owner = c;
        const ExactWeights weights = oracle.barycentrics(owner.element, p);
        std::size_t channel = 0;
        for (const int f : fields_) {
            const Field& field = mesh_->fields[std::size_t(f)];
            for (int c = 0; c < field.components; ++c)
                block.values[channel++ * block.count() + offset] =
                    valueOf(oracle, field, c, owner.element, weights);
        }
    }

    const TetMesh* mesh_;
    std::vector<int> fields_;
};

}  // namespace

std::unique_ptr<BoundResampler> OracleResampler::bind(const TetMesh& mesh, std::span<const int> fields,
                                                      const BindOptions& options) const {
    if (!options.target.empty() && options.target != "default") throw InputError("the oracle has one target");
    if (options.format != SampleFormat::r32f) throw InputError("the oracle has one format");
    return std::make_unique<BoundOracle>(mesh, fields);
}

}  // namespace tessera::contract
