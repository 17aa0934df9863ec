#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gl/gl_thread.h"
#include "mesh/field_range.h"
#include "pool/brick_pool.h"
#include "render/placed_bricks.h"
#include "tessera/mesh.h"
#include "tessera/vec.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// Of a ValueHistogram.
inline constexpr std::size_t kHistogramBins = 64;

/// Volume by value.
class ValueHistogram {
  public:
    explicit ValueHistogram(const std::array<double, 2>& range) : range_(range), shares_(kHistogramBins) {}
    /// What lies outside the range, or isn't finite, isn't counted.
    void add(double value, double volume);
    /// What another one of the same range has counted.
    void add(const ValueHistogram& other);
    /// Of what was counted: bins of one width over the range.
    std::vector<double> shares() const;

  private:
    std::array<double, 2> range_;
    std::vector<double> shares_;
    double all_ = 0;
};

/// Of one component of a field, counted from 0, or of a vector without one of its length: "T", "v 2", "|v|".
/// Throws InputError for a component that there isn't.
std::string titleOf(const OutputField& field, std::optional<int> component);

/// A field that pictures may show.
struct PictureField {
    std::string name;  ///< as scenes write it
    int components = 1;
};

/// What pictures are drawn of: the bricks of one field in a pool of an OpenGL device.
class PictureSource {
  public:
    virtual ~PictureSource() = default;

    /// Of the values, for a legend: "T", "|v|", "v 2".
    virtual const std::string& title() const = 0;
    /// Of what lies in the mesh.
    virtual const Box3d& boundsWorld() const = 0;
    /// Of the finite values, of which there are some.
    virtual const ValueRange& range() const = 0;
    /// Shares of the mesh's volume by value: bins of one width over a range.
    const std::vector<double>& histogram(const std::array<double, 2>& range) const;

    /// All that the file has.
    virtual const std::vector<PictureField>& fields() const = 0;
    /// What the bricks are made of; null where it isn't known.
    virtual const TetMesh* sourceMesh() const { return nullptr; }

    /// The largest error measured in each of bricks(), over the field's range, NaN where none was; empty
    /// where that isn't known.
    virtual std::vector<float> brickErrors() const { return {}; }

    // What is to be drawn, as it is now:
    virtual const BrickPool& pool() const = 0;
    virtual const BrickFrame& frame() const = 0;
    /// What pool().state() shows.
    virtual std::span<const PlacedBrick> bricks() const = 0;

    /// A brick's samples, over its closed box.
    struct Samples {
        DepthKey key;
        std::shared_ptr<const Block> block;
    };
    /// Of the brick that holds a place; none outside of all.
    virtual std::optional<Samples> samplesAt(const Vec3d& placeWorld) const = 0;
    /// The value at a place, interpolated; none outside the mesh.
    std::optional<double> valueAt(const Vec3d& placeWorld) const;

    /// Another device takes the place of the one before, which may be lost. Throws GlError.
    virtual void moveTo(GlThread& thread) = 0;

  private:
    /// Adds all there is.
    virtual void fill(ValueHistogram& histogram) const = 0;

    /// The last one: every picture asks for it.
    struct Histogram {
        std::array<double, 2> range;
        std::vector<double> shares;
    };
    mutable std::optional<Histogram> histogram_;
};

}  // namespace tessera
