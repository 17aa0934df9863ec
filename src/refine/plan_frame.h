#pragma once

#include "refine/brick_plan.h"
#include "refine/refine_options.h"

namespace tessera {

/// Throws InputError for options out of range or that contradict each other, and for a mesh without elements
/// or extent.
void checkOptions(const TetMesh& mesh, const Box3d& meshBoundsWorld, const RefineOptions& options);

/// mesh.boundsWorld(), on all threads; of the index, where there is one.
Box3d meshBounds(const TetMesh& mesh, const Execution& execution, const ElementIndex* index = nullptr);

/// The index that the options share, where it is built already; else null.
inline const ElementIndex* builtIndex(const RefineOptions& options) {
    return options.bind.index ? options.bind.index->ifBuilt() : nullptr;
}

/// True when the user fixed the finest spacing.
inline bool hasFinestSpacing(const RefineOptions& options) {
    return options.resolution > 0 || options.spacingWorld > 0 || options.frame.has_value();
}

/// The lattices for these options. With a finest spacing given, depth frame.maxDepth has it; else depth 0 has
/// 64 points (32 for bricks of 8) along the longest axis, from the bounds' minimum to their maximum, and so
/// has every finer one. Throws InputError for a spacing that sampling can't compute with.
PlanFrame chooseFrame(const Box3d& meshBoundsWorld, const RefineOptions& options);

/// The finest spacing, or that of 256 points where none is given: h_0 of focuses.
double focusSpacing(const Box3d& meshBoundsWorld, const RefineOptions& options);

/// About how many points are sampled, before there is a plan: the finest lattice's in the bounds or, where
/// bricks differ, samplesPerElement^3 an element if that is less; no more than the bounds on voxels and
/// memory allow. Takes any options.
std::int64_t expectedPoints(const TetMesh& mesh, const Box3d& meshBoundsWorld, const RefineOptions& options);

/// Leaves that the bounds on voxels and memory allow.
std::size_t leafBudget(const RefineOptions& options, int channels);

}  // namespace tessera
