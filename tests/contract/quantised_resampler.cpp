#include "quantised_resampler.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mesh/field_range.h"
#include "tessera/lattice.h"

namespace tessera::contract {

namespace {

/// Values that float can't hold are not finite.
ValueRange rangeOf(const Field& field, int component) {
    ValueRange range;
    for (std::size_t i = std::size_t(component); i < field.values.size(); i += std::size_t(field.components))
        if (std::isfinite(float(field.values[i]))) {
            range.min = std::min(range.min, field.values[i]);
            range.max = std::max(range.max, field.values[i]);
        }
    return range;
}

/// Steps of the format at t in [0, 1].
double stepAt(SampleFormat format, double t) {
    if (format == SampleFormat::r8) return 1.0 / 255;
    if (format == SampleFormat::r16) return 1.0 / 65535;
    return t < 0x1p-14 ? 0x1p-24 : std::ldexp(1.0, std::ilogb(t) - 10);
}

/// Cut off to steps below; `more` steps are added.
double quantised(double value, const ValueRange& range, SampleFormat format, double more) {
    if (!(range.width() > 0) || format == SampleFormat::r32f) return value;
    const double t = std::clamp((value - range.min) / range.width(), 0.0, 1.0), step = stepAt(format, t);
    const double steps = format == SampleFormat::r16f ? std::floor(t / step) : std::floor(t / step + 1e-9);
    return std::clamp(range.min + (steps + more) * step * range.width(), range.min, range.max);
}

class BoundQuantised : public BoundResampler {
  public:
    BoundQuantised(const Resampler& exact, const TetMesh& mesh, std::span<const int> fields,
                   const BindOptions& options, Cheat cheat)
        : format_(options.format), cheat_(cheat) {
        for (const int f : fields) {
            const Field& field = mesh.fields[std::size_t(f)];
            for (int c = 0; c < field.components; ++c) ranges_.push_back(rangeOf(field, c));
        }
        BindOptions inside = options;
        inside.format = SampleFormat::r32f;
        if (cheat == Cheat::truncatesTwice) inside.index = nullptr;  // of another mesh
        if (cheat != Cheat::truncatesTwice) {
            bound_ = exact.bind(mesh, fields, inside);
            return;
        }
        coarse_ = mesh;
        for (Field& field : coarse_.fields)
            for (int c = 0; c < field.components; ++c) {
                const ValueRange range = rangeOf(field, c);
                for (std::size_t i = std::size_t(c); i < field.values.size();
                     i += std::size_t(field.components))
                    if (std::isfinite(float(field.values[i])))
                        field.values[i] = quantised(field.values[i], range, format_, 0);
            }
        bound_ = exact.bind(coarse_, fields, inside);
    }

    std::string_view target() const override { return bound_->target(); }

    ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                const BlockSink& sink, const Execution& execution) override {
        const auto through = [&](std::size_t box, const Block& exact) {
            Block block = exact;
            for (int c = 0; c < block.channels; ++c) quantise(block, c);
            sink(box, block);
        };
        return bound_->resample(lattice, boxes, through, execution);
    }

  private:
    void quantise(Block& block, int channel) const {
        ValueRange range = ranges_[std::size_t(channel)];
        const std::span values(block.values.data() + std::size_t(channel) * block.count(), block.count());
        if (cheat_ == Cheat::takesRangeOfBox) {
            range = {};
            for (std::size_t i = 0; i < values.size(); ++i)
                if (block.coverage[i] && std::isfinite(values[i]))
                    range.min = std::min(range.min, double(values[i])),
                    range.max = std::max(range.max, double(values[i]));
        }
        const double more = cheat_ == Cheat::oneAndAHalfStepsOff ? 1.5 : 0;
        for (std::size_t i = 0; i < values.size(); ++i) {
            if (!block.coverage[i]) continue;
            if (std::isfinite(values[i]))
                values[i] = float(quantised(double(values[i]), range, format_, more));
            else if (cheat_ == Cheat::losesInvalidPoints)
                values[i] = float(range.min);
            if (cheat_ == Cheat::leavesCoverageOut && values[i] == float(range.min)) block.coverage[i] = 0;
        }
    }

    SampleFormat format_;
    Cheat cheat_;
    std::vector<ValueRange> ranges_;
    TetMesh coarse_;
    std::unique_ptr<BoundResampler> bound_;
};

}  // namespace

ResamplerInfo QuantisedResampler::infoOf(const Resampler& exact, const QuantisedOptions& options) {
    const double bound = options.boundVoxels;
    return {.name = "quantised",
            .description = "values kept in few bits",
            .formats = {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8},
            .spillBoundVoxels = bound > 0 ? bound : exact.info().spillBoundVoxels,
            .placeBoundVoxels = bound > 0 ? bound : exact.info().placeBoundVoxels};
}

std::unique_ptr<BoundResampler> QuantisedResampler::bind(const TetMesh& mesh, std::span<const int> fields,
                                                         const BindOptions& options) const {
    return std::make_unique<BoundQuantised>(*exact_, mesh, fields, options, options_.cheat);
}

}  // namespace tessera::contract
