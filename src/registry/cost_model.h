#pragma once

#include <span>
#include <string>

#include "tessera/registry.h"

namespace tessera {

/// Time that an algorithm takes: linear in the elements, the points, and the slices that elements meet, which
/// are as many as elements of one size on a cube of points would meet. Milliseconds.
struct CostModel {
    double fixedMs = 0, elementMs = 0, pointMs = 0, sliceMs = 0;

    double ms(const WorkSize& work) const;
    /// No coefficient is negative or absurd, and not all are 0.
    bool isSane() const;
    friend bool operator==(const CostModel&, const CostModel&) = default;
};

struct TimedWork {
    WorkSize work;
    double ms = 0;
};

/// The model with the least squares of relative errors, no coefficient negative. Times are above 0.
CostModel fitCost(std::span<const TimedWork> timed);

/// An algorithm among which "auto" chooses.
struct Candidate {
    const Resampler* resampler = nullptr;
    /// Why it can't be chosen: the rest of a sentence that begins with its name. Empty where it can.
    std::string whyNot{};
    CostModel cost{};
};

/// The candidate with the least predicted time, and a sentence that tells the times of all. Times aren't told
/// where only one can be chosen. Throws InputError, with the reasons, when none can.
ResamplerChoice chooseByCost(std::span<const Candidate> candidates, const WorkSize& work);

}  // namespace tessera
