#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "base/parallel.h"
#include "tessera/lattice.h"
#include "tessera/resampler.h"

namespace tessera {

/// The plainest resampler that can be right: every element is tried at every point of its bounding box, in
/// double, with a small tolerance; the lowest element wins. For tests of what stands above the contract, on
/// small meshes.
class BruteForceResampler : public Resampler {
  public:
    BruteForceResampler()
        : Resampler({.name = "brute-force",
                     .description = "point in element, in double",
                     .spillBoundVoxels = 1e-6,
                     .placeBoundVoxels = 1e-6}) {}
    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions&) const override {
        return std::make_unique<Bound>(mesh, fields);
    }

  private:
    class Bound : public BoundResampler {
      public:
        Bound(const TetMesh& mesh, std::span<const int> fields)
            : mesh_(mesh), fields_(fields.begin(), fields.end()) {}

        ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                    const BlockSink& sink, const Execution& execution) override {
            parallelFor(execution, std::int64_t(boxes.size()), [&](std::int64_t b) {
                Block block;
                block.lattice = lattice;
                block.box = boxes[std::size_t(b)];
                for (const int f : fields_) block.channels += mesh_.fields[std::size_t(f)].components;
                block.values.assign(std::size_t(block.channels) * block.count(), -12345.0f);
                block.coverage.assign(block.count(), 0);
                for (std::int64_t e = 0; e < mesh_.elementCount(); ++e) sample(block, e);
                sink(std::size_t(b), block);
            });
            return {};
        }

      private:
        void sample(Block& block, std::int64_t element) const {
            const double h = block.lattice.uWorld.x;
            std::array<Vec3d, 4> v;
            Box3d bounds;
            for (std::size_t i = 0; i < 4; ++i) {
                v[i] = (mesh_.points[std::size_t(mesh_.tets[std::size_t(element)][i])] -
                        block.lattice.originWorld) /
                       h;
                bounds.include(v[i]);
            }
            const double volume = glm::dot(glm::cross(v[1] - v[0], v[2] - v[0]), v[3] - v[0]);
            if (volume == 0) return;
            const Vec3i low = glm::max(block.box.min, Vec3i(glm::ceil(bounds.min - 1e-7)));
            const Vec3i high = glm::min(block.box.max, Vec3i(glm::floor(bounds.max + 1e-7)) + 1);
            for (int k = low.z; k < high.z; ++k)
                for (int j = low.y; j < high.y; ++j)
                    for (int i = low.x; i < high.x; ++i) {
                        const Vec3d p(i, j, k);
                        std::array<double, 4> w;
                        w[1] = glm::dot(glm::cross(p - v[0], v[2] - v[0]), v[3] - v[0]) / volume;
                        w[2] = glm::dot(glm::cross(v[1] - v[0], p - v[0]), v[3] - v[0]) / volume;
                        w[3] = glm::dot(glm::cross(v[1] - v[0], v[2] - v[0]), p - v[0]) / volume;
                        w[0] = 1 - w[1] - w[2] - w[3];
                        if (*std::min_element(w.begin(), w.end()) < -1e-9) continue;
                        write(block, {i, j, k}, element, w);
                    }
        }

        void write(Block& block, const Vec3i& p, std::int64_t element, const std::array<double, 4>& w) const {
            const std::size_t at = block.offset(p);
            if (block.coverage[at]) return;
            block.coverage[at] = 1;
            std::size_t channel = 0;
            for (const int f : fields_) {
                const Field& field = mesh_.fields[std::size_t(f)];
                for (int c = 0; c < field.components; ++c, ++channel) {
                    double value = 0;
                    if (field.location == FieldLocation::cell) {
                        value = field.at(element, c);
                    } else {
                        for (std::size_t i = 0; i < 4; ++i)
                            value += w[i] * field.at(mesh_.tets[std::size_t(element)][i], c);
                    }
                    block.values[channel * block.count() + at] = float(value);
                }
            }
        }

        const TetMesh& mesh_;
        std::vector<int> fields_;
    };
};

}  // namespace tessera
