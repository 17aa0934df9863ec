#pragma once

#include "resample/resampler.h"

namespace tessera::contract {

/// What a QuantisedResampler does wrong.
enum class Cheat {
    none,
    truncatesTwice,       ///< the node values, and the result again
    oneAndAHalfStepsOff,  ///< half a step up and one more
    takesRangeOfBox,      ///< normalises to the range of the values in the box
    losesInvalidPoints,   ///< gives the least value where the field isn't finite
    leavesCoverageOut,    ///< treats the least value as not covered, as a target without a mask would
};

struct QuantisedOptions {
    Cheat cheat = Cheat::none;
    /// The bounds that it claims; 0: those of the resampler inside.
    double boundVoxels = 0;
};

/// An exact resampler whose values go through a normalised format, truncated, as some OpenGL drivers do. It
/// shows that the suite passes what the clauses allow and nothing more.
class QuantisedResampler : public Resampler {
  public:
    explicit QuantisedResampler(const Resampler& exact, const QuantisedOptions& options = {})
        : exact_(&exact), options_(options) {}

    std::string_view name() const override { return "quantised"; }
    std::string_view description() const override { return "values kept in few bits"; }
    std::vector<std::string> targets() const override { return exact_->targets(); }
    std::vector<SampleFormat> formats() const override;
    double spillBoundVoxels() const override;
    double placeBoundVoxels() const override;
    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions& options = {}) const override;

  private:
    const Resampler* exact_;
    QuantisedOptions options_;
};

}  // namespace tessera::contract
