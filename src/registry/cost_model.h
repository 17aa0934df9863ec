#pragma once

#include <span>
#include <string>

#include "tessera/registry.h"

namespace tessera {

/// Time that an algorithm takes, linear in its work; milliseconds.
struct CostModel {
    double fixedMs = 0, elementMs = 0, pointMs = 0;

    double ms(const WorkSize& work) const {
        return fixedMs + elementMs * double(work.elements) + pointMs * double(work.points);
    }
    /// No coefficient is negative or absurd, and not all are 0.
    bool isSane() const;
    friend bool operator==(const CostModel&, const CostModel&) = default;
};

struct TimedWork {
    WorkSize work;
    double ms = 0;
};

/// The plane through three times: of little work, of that with more elements, and of that with more points.
/// What would be negative is 0, and the rest is then what little work takes.
CostModel fitCost(const TimedWork& little, const TimedWork& moreElements, const TimedWork& morePoints);

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
