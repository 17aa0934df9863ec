#pragma once

namespace tessera {

/// What decides how fine bricks are.
enum class Criterion {
    /// One spacing everywhere.
    uniform,
    /// A number of samples along the edges of the elements that are there.
    elementSize,
    /// Bricks are halved until the measured error is within a bound.
    error
};

/// Which error a bound holds for.
enum class ErrorMeasure {
    /// The largest of all samples.
    max,
    /// The root of the mean square over the mesh's volume.
    rms
};

}  // namespace tessera
