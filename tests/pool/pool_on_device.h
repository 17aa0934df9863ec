#pragma once

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <vector>

#include "pool/brick_pool.h"
#include "pool/pool_target.h"

namespace tessera {

/// What a state of a pool holds on the device, read back: the words of its index and all texels.
class PoolOnDevice {
  public:
    PoolOnDevice(const BrickPool& pool, const PoolState& state) : pool_(pool) {
        pool.thread().run([&](GlContext& context) {
            const GlFunctions& gl = context.functions();
            words_.resize(std::size_t(state.index->bytes()) / 4);
            gl.GetNamedBufferSubData(state.index->id(), 0, GLsizeiptr(words_.size() * 4), words_.data());
            gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
            const TexelCoding& coding = pool.coding();
            const Vec3i size = pool.layout().texels();
            const auto texels = std::size_t(size.x) * std::size_t(size.y) * std::size_t(size.z);
            for (int atlas = 0; atlas < pool.atlases(); ++atlas)
                for (std::size_t group = 0; group < coding.groupCount(); ++group) {
                    auto& codes = codes_.emplace_back(texels * std::size_t(coding.texelBytes(group)));
                    auto& coverage = coverage_.emplace_back(2 * texels);
                    gl.GetTextureImage(pool.codes(atlas, group).id(), 0, coding.pixelFormat(group),
                                       coding.pixelType(), GLsizei(codes.size()), codes.data());
                    gl.GetTextureImage(pool.coverage(atlas, group).id(), 0, GL_RG, GL_UNSIGNED_BYTE,
                                       GLsizei(coverage.size()), coverage.data());
                }
        });
    }

    /// Goes down the index as its layout says, from a place counted in bricks of depth 0 from the lattice's
    /// origin: the number and the depth of the leaf there.
    std::optional<std::pair<std::uint32_t, int>> walk(const Vec3d& place) const {
        const Vec3i gridMin{int(words_[0]), int(words_[1]), int(words_[2])};
        const Vec3i gridSize{int(words_[4]), int(words_[5]), int(words_[6])};
        const int lift = int(words_[3]);
        const std::uint32_t firstNode = words_[7];
        Vec3d rest = place * std::ldexp(1.0, -lift);
        const Vec3d floor = glm::floor(rest);
        const Vec3i cell = Vec3i(floor) - gridMin;
        rest -= floor;
        for (int a = 0; a < 3; ++a)
            if (cell[a] < 0 || cell[a] >= gridSize[a]) return std::nullopt;
        std::uint32_t entry = words_[8 + std::size_t((cell.z * gridSize.y + cell.y) * gridSize.x + cell.x)];
        int depth = -lift;
        while ((entry & 3) == 2) {
            rest *= 2.0;
            const Vec3d upper = glm::floor(rest);
            rest -= upper;
            const auto child =
                std::uint32_t(upper.x) | std::uint32_t(upper.y) << 1 | std::uint32_t(upper.z) << 2;
            entry = words_.at(8 + firstNode + 8 * (entry >> 2) + child);
            ++depth;
        }
        if (entry == 0) return std::nullopt;
        EXPECT_EQ(entry & 3, 1u);
        return std::pair(entry >> 2, depth);
    }

    std::uint8_t coverage(std::uint32_t slot, std::size_t group, const Vec3i& local) const {
        return coverage_[plane(slot, group)][2 * texel(slot, local)];
    }
    /// surfaceCode() less that of the surface.
    int surface(std::uint32_t slot, std::size_t group, const Vec3i& local) const {
        return int(coverage_[plane(slot, group)][2 * texel(slot, local) + 1]) - 128;
    }
    /// The bits of a code.
    std::uint32_t bits(std::uint32_t slot, int channel, const Vec3i& local) const {
        const std::size_t group = std::size_t(channel) / kChannelsAGroup;
        const auto texelBytes = std::size_t(pool_.coding().texelBytes(group));
        const std::size_t components = pool_.coding().channelsOf(group) <= 1 ? 1 : kChannelsAGroup;
        const std::size_t bytes = texelBytes / components;
        const std::size_t at =
            texel(slot, local) * texelBytes + std::size_t(channel % kChannelsAGroup) * bytes;
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < bytes; ++i)
            value |= std::uint32_t(codes_[plane(slot, group)][at + i]) << (8 * i);
        return value;
    }
    /// The code as a shader reads it.
    double code(std::uint32_t slot, int channel, const Vec3i& local) const {
        const std::uint32_t value = bits(slot, channel, local);
        switch (pool_.coding().format()) {
            case SampleFormat::r32f:
                return double(std::bit_cast<float>(value));
            case SampleFormat::r16f:
                return double(floatFromHalf(std::uint16_t(value)));
            case SampleFormat::r16:
                return value / 65535.0;
            case SampleFormat::r8:
                return value / 255.0;
        }
        return 0;
    }

    /// Whether both hold the same bytes in a slot.
    bool agreesIn(std::uint32_t slot, const PoolOnDevice& other) const {
        const int edge = pool_.layout().edge;
        for (std::size_t group = 0; group < pool_.coding().groupCount(); ++group) {
            const std::size_t at = plane(slot, group);
            const auto bytes = std::size_t(pool_.coding().texelBytes(group));
            const auto isSame = [&](const auto& planes, const auto& others, std::size_t first,
                                    std::size_t size) {
                return std::memcmp(&planes[at][first * size], &others[at][first * size],
                                   std::size_t(edge) * size) == 0;
            };
            for (int row = 0; row < edge * edge; ++row) {
                const std::size_t first = texel(slot, Vec3i(0, row % edge, row / edge));
                if (!isSame(codes_, other.codes_, first, bytes)) return false;
                if (!isSame(coverage_, other.coverage_, first, 2)) return false;
            }
        }
        return true;
    }
    const std::vector<std::uint32_t>& words() const { return words_; }

  private:
    std::size_t plane(std::uint32_t slot, std::size_t group) const {
        return std::size_t(pool_.layout().atlasOf(slot)) * pool_.coding().groupCount() + group;
    }
    std::size_t texel(std::uint32_t slot, const Vec3i& local) const {
        const Vec3i p = pool_.layout().firstTexel(slot) + local, n = pool_.layout().texels();
        return (std::size_t(p.z) * std::size_t(n.y) + std::size_t(p.y)) * std::size_t(n.x) + std::size_t(p.x);
    }

    const BrickPool& pool_;
    std::vector<std::uint32_t> words_;
    std::vector<std::vector<std::uint8_t>> codes_, coverage_;  // atlas by atlas, group by group
};

}  // namespace tessera
