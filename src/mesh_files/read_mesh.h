#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mesh/split_cells.h"
#include "tessera/error.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// What was found while reading and splitting; counts are of elements (tets) unless they say cells or nodes.
struct ImportStatistics {
    std::string format;                                  ///< e.g. "VTK XML unstructured grid"
    std::int64_t cells = 0;                              ///< 3D cells read
    std::array<std::int64_t, kCellKinds> cellsOfKind{};  ///< of these, by CellKind
    std::int64_t skippedCells = 0;                       ///< points, lines, surfaces and unsupported cells
    std::int64_t blankedCells = 0;                       ///< blanked, hidden or ghost: left out
    std::int64_t higherOrderCells = 0;                   ///< read by their corner nodes only
    std::int64_t blocks = 1;
    std::int64_t addedNodes = 0;  ///< centres added to split polyhedra
    std::int64_t nodes = 0;
    std::int64_t elements = 0;
    std::int64_t flat = 0;                ///< exactly zero volume
    std::int64_t inverted = 0;            ///< negative volume
    std::int64_t duplicate = 0;           ///< same four nodes as an earlier element
    std::int64_t coincidentNodes = 0;     ///< nodes at exactly the place of an earlier node
    std::int64_t boundaryFaces = 0;       ///< faces of one element only
    std::int64_t nonConformingFaces = 0;  ///< faces shared by more than two elements, and boundary faces
                                          ///< that lie inside the mesh (a hanging node on them)
    double smallestEdgeWorld = 0;
    double largestEdgeWorld = 0;
    double smallestVolumeWorld = 0;  ///< |volume| of elements that are not flat
    double largestVolumeWorld = 0;
    std::vector<std::string> warnings;  ///< one sentence each
    std::vector<std::string> notes;     ///< what was made of the file, one sentence each
};

struct ReadOptions {
    std::vector<std::string> fields;        ///< names to read; empty: all
    int timeStep = -1;                      ///< formats with steps: which one, counted from 0; -1: the last
    std::vector<std::string> otherParts{};  ///< further files of the same format that hold parts of this mesh
    /// The file that names this one, a .pvd file; empty: none. In its folder and below it files may name
    /// others, else in the folder of the file that is read.
    std::string namedBy{};
    bool followsLinks = false;  ///< they may name others anywhere
};

/// The folder in which a file and those that it names have to lie; none where it may be any.
std::optional<std::string> allowedFolder(const std::string& path, const ReadOptions& options);
/// A file that the user named lies where it wants to; one that a .pvd file names doesn't. Throws InputError
/// for one outside the folder of `options.namedBy`.
void checkParts(const std::string& path, const ReadOptions& options);

struct MeshFile {
    TetMesh mesh;
    ImportStatistics statistics;
    /// Where another process read it: the most memory that one held, and what this one held then. Else 0.
    std::int64_t readPeakBytes = 0;
};

/// Reads a mesh in any supported format (docs/formats in README): cells are split into tetrahedra so that
/// both sides of a shared face take the same diagonal; points stay double. Field names are unique: where
/// points and cells have a field of one name, that of the cells gets the suffix "_cell". Throws InputError,
/// naming the file and the place, when the file is missing, empty, damaged, of unknown format, has no 3D
/// cells, a node index out of range, a coordinate that isn't finite (says which node), a non-numeric array or
/// no such field (lists those there). With otherParts all files are one mesh: cells that a part has as ghosts
/// are left out, and nodes of different parts that lie at exactly one place, with the same values, are one.
MeshFile readMesh(const std::string& path, const ReadOptions& options, const Execution& execution);

/// Whether a field of this name and place is called so in ReadOptions::fields: by its name, or by
/// "point:name" or "cell:name", the latter also for a cell field whose name got the suffix "_cell".
bool isFieldCalled(const std::string& called, const std::string& name, FieldLocation location);

/// readMesh for VTK XML, legacy VTK and TetGen files alone: a program that calls only this starts ten times
/// faster, as it doesn't load the libraries of other formats. Throws OtherFormatError for those.
MeshFile readCommonMesh(const std::string& path, const ReadOptions& options, const Execution& execution);

/// The file's format is one that readMesh knows and readCommonMesh doesn't.
class OtherFormatError : public InputError {
  public:
    using InputError::InputError;
};

}  // namespace tessera
