#pragma once

#include "tessera/resampler.h"

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
        : QuantisedResampler(exact, options, infoOf(exact, options)) {}

    std::vector<std::string> targets() const override { return exact_->targets(); }
    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions& options = {}) const override;

  protected:
    QuantisedResampler(const Resampler& exact, const QuantisedOptions& options, ResamplerInfo info)
        : Resampler(std::move(info)), exact_(&exact), options_(options) {}
    static ResamplerInfo infoOf(const Resampler& exact, const QuantisedOptions& options);

  private:
    const Resampler* exact_;
    QuantisedOptions options_;
};

}  // namespace tessera::contract
