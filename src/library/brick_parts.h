#pragma once

#include <memory>
#include <optional>
#include <string>

#include "brick/seams.h"
#include "library/field_choice.h"
#include "refine/brick_result.h"
#include "refine/refine_options.h"
#include "tessera/bricks.h"
#include "tessera/resampler.h"

namespace tessera {

/// What Bricks are made of: samples, and all that made them.
struct Bricks::Parts {
    const TetMesh* mesh = nullptr;
    std::string sourceFile;
    std::optional<double> time;
    BrickOptions options;
    /// The same by indices.
    RefineOptions refine;
    const Resampler* resampler = nullptr;
    ChosenFields chosen;
    BrickResult result;
    /// Of the mesh: shared by copies.
    std::shared_ptr<const NearestOnDemand> nearest;
};

}  // namespace tessera
