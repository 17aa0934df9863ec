#include "resample/resampler.h"

namespace tessera {

ResampleStatistics& ResampleStatistics::operator+=(const ResampleStatistics& other) {
    elementBlockPairs += other.elementBlockPairs;
    exactElements += other.exactElements;
    scanlines += other.scanlines;
    contested += other.contested;
    coveredPoints += other.coveredPoints;
    binMs += other.binMs;
    sampleMs += other.sampleMs;
    return *this;
}

Block resampleBlock(const Resampler& resampler, const TetMesh& mesh, std::span<const int> fields,
                    const Lattice& lattice, const IndexBox& box, const Execution& execution) {
    Block result;
    const auto bound = resampler.bind(mesh, fields);
    bound->resample(
        lattice, std::span(&box, 1), [&](std::size_t, const Block& block) { result = block; }, execution);
    return result;
}

}  // namespace tessera
