#include "job/vdb_contents.h"

#include <fmt/format.h>

#include "reader/isolated_vdb.h"
#include "tessera/error.h"
#include "vdb/vdb_read.h"

namespace tessera {

VdbFile openVdb(const std::string& path, VdbContents contents, const Job& job) {
    if (!job.reader) return readVdb(path);
    return readVdbIsolated(*job.reader, path, contents, job.readerLimits, job.execution);
}

FixedFrame openVdbLattice(const std::string& path, const Job& job) {
    if (!job.reader) return readVdbLattice(path);
    return readVdbLatticeIsolated(*job.reader, path, job.readerLimits, job.execution);
}

Box3d coveredBounds(const VdbFile& file) {
    Box3d bounds;
    const int n = file.store.tilesPerEdge();
    for (std::size_t leaf = 0; leaf < file.tree.leafCount(); ++leaf) {
        const BrickKey& key = file.tree.leaves()[leaf];
        const Lattice lattice = file.tree.lattice(key.level);
        const Vec3i first = file.tree.ownedPoints(key).min;
        for (int t = 0; t < file.store.tileCount(); ++t) {
            const Tile* tile = file.store.tile(leaf, t);
            if (!tile) continue;
            const Vec3i corner = first + kTileSize * Vec3i(t / (n * n), t / n % n, t % n);
            for (int offset = 0; offset < kTilePoints; ++offset)
                if (tile->covered(offset))
                    bounds.include(lattice.worldFromIndex(
                        Vec3d(corner + Vec3i(offset / 64, offset / 8 % 8, offset % 8))));
        }
    }
    return bounds;
}

const OutputField& chooseField(const VdbFile& file, const std::string& name) {
    if (file.fields.empty())
        throw InputError("the file holds no field, only which voxels lie in the mesh: nothing to draw");
    std::string there;
    for (const OutputField& field : file.fields) {
        if (field.name == name || (name.empty() && &field == &file.fields.front())) return field;
        there += (there.empty() ? "" : ", ") + field.name;
    }
    throw InputError(fmt::format("no field named '{}'; there are: {}", name, there));
}

}  // namespace tessera
