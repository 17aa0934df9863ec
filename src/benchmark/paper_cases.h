#pragma once

#include <deque>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "benchmark/benchmark_variants.h"
#include "benchmark/paper_figures.h"
#include "benchmark/timed_cases.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

/// The grids of Weiler and Ertl 2001 on a mesh, its double (mirrored at a plane perpendicular to y) and its
/// quadruple (y and z), each by the methods that they timed and by peers: what is sampled, and what of it.
class PaperCases {
  public:
    /// @param variants those that are timed: software, hybrid and slicing with primitives by the processor,
    /// as they were published, and peers; found by their roles and algorithms. @param mostPoints along an
    /// axis: larger grids are left out. @param mostSets of the mesh and its multiples. The variants must
    /// outlive it.
    PaperCases(const TetMesh& mesh, const std::string& meshName, std::span<const BenchmarkVariant> variants,
               int mostPoints, std::size_t mostSets);

    /// What is run; refers to this object, which must stay where it is.
    std::vector<TimedCase> timedCases();
    /// @param times those cases after their rounds, in the same order.
    Json json(std::span<const TimedCase> times) const;

  private:
    struct DataSet {
        const PaperDataSet* published = nullptr;
        std::string name;
        TetMesh mesh;
        std::vector<std::unique_ptr<BoundResampler>> bound;  ///< by variant
    };
    struct Case {
        std::size_t set = 0, variant = 0;
        const PaperGrid* grid = nullptr;
        Lattice lattice;
        std::vector<IndexBox> boxes;
    };

    std::vector<const BenchmarkVariant*> variants_;
    std::deque<DataSet> sets_;
    std::vector<Case> cases_;
};

}  // namespace tessera
