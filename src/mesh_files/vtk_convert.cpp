#include "mesh_files/vtk_convert.h"

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkDataSet.h>
#include <vtkDataSetAttributes.h>
#include <vtkIdList.h>
#include <vtkIdTypeArray.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPointSet.h>
#include <vtkPoints.h>
#include <vtkRectilinearGrid.h>
#include <vtkSmartPointer.h>
#include <vtkStructuredGrid.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

#include <algorithm>
#include <initializer_list>
#include <limits>
#include <set>
#include <span>

#include "base/large_pages.h"
#include "base/parallel.h"
#include "base/text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::int64_t kConvertChunk = 1 << 15;

/// What a VTK cell type is to us.
struct CellRule {
    bool solid = false;
    CellKind kind = CellKind::tet;
    int corners = 0;
    bool higherOrder = false;
};

CellRule ruleOf(int type) {
    switch (type) {
        case VTK_TETRA:
            return {true, CellKind::tet, 4, false};
        case VTK_VOXEL:
            return {true, CellKind::voxel, 8, false};
        case VTK_HEXAHEDRON:
            return {true, CellKind::hex, 8, false};
        case VTK_WEDGE:
            return {true, CellKind::wedge, 6, false};
        case VTK_PYRAMID:
            return {true, CellKind::pyramid, 5, false};
        case VTK_PENTAGONAL_PRISM:
            return {true, CellKind::polyhedron, 10, false};
        case VTK_HEXAGONAL_PRISM:
            return {true, CellKind::polyhedron, 12, false};
        case VTK_POLYHEDRON:
            return {true, CellKind::polyhedron, 0, false};
        case VTK_QUADRATIC_TETRA:
        case VTK_HIGHER_ORDER_TETRAHEDRON:
        case VTK_LAGRANGE_TETRAHEDRON:
        case VTK_BEZIER_TETRAHEDRON:
            return {true, CellKind::tet, 4, true};
        case VTK_QUADRATIC_HEXAHEDRON:
        case VTK_TRIQUADRATIC_HEXAHEDRON:
        case VTK_BIQUADRATIC_QUADRATIC_HEXAHEDRON:
        case VTK_HIGHER_ORDER_HEXAHEDRON:
        case VTK_LAGRANGE_HEXAHEDRON:
        case VTK_BEZIER_HEXAHEDRON:
            return {true, CellKind::hex, 8, true};
        case VTK_QUADRATIC_WEDGE:
        case VTK_QUADRATIC_LINEAR_WEDGE:
        case VTK_BIQUADRATIC_QUADRATIC_WEDGE:
        case VTK_HIGHER_ORDER_WEDGE:
        case VTK_LAGRANGE_WEDGE:
        case VTK_BEZIER_WEDGE:
            return {true, CellKind::wedge, 6, true};
        case VTK_QUADRATIC_PYRAMID:
        case VTK_TRIQUADRATIC_PYRAMID:
        case VTK_HIGHER_ORDER_PYRAMID:
        case VTK_LAGRANGE_PYRAMID:
        case VTK_BEZIER_PYRAMID:
            return {true, CellKind::pyramid, 5, true};
        default:
            return {};
    }
}

/// Tags of points and cells that take no part in the result.
struct Ghosts {
    const unsigned char* cells = nullptr;
    const unsigned char* points = nullptr;
    unsigned char cellMask = 0;

    bool hidesCell(std::int64_t c) const { return cells && (cells[c] & cellMask); }
    bool hidesPoint(std::int64_t p) const {
        return points && (points[p] & vtkDataSetAttributes::HIDDENPOINT);
    }
};

const unsigned char* tags(vtkDataSetAttributes* attributes, const char* name, vtkIdType count) {
    auto* array = vtkUnsignedCharArray::SafeDownCast(attributes->GetAbstractArray(name));
    return array && array->GetNumberOfComponents() == 1 && array->GetNumberOfTuples() == count
               ? array->GetPointer(0)
               : nullptr;
}

Ghosts ghostsOf(vtkDataSet* data) {
    Ghosts ghosts;
    ghosts.points =
        tags(data->GetPointData(), vtkDataSetAttributes::GhostArrayName(), data->GetNumberOfPoints());
    ghosts.cells =
        tags(data->GetCellData(), vtkDataSetAttributes::GhostArrayName(), data->GetNumberOfCells());
    ghosts.cellMask = vtkDataSetAttributes::DUPLICATECELL | vtkDataSetAttributes::HIDDENCELL |
                      vtkDataSetAttributes::REFINEDCELL;
    if (!ghosts.cells) {
        // Files from before VTK 6.3: any level above 0 is a ghost.
        ghosts.cells = tags(data->GetCellData(), "vtkGhostLevels", data->GetNumberOfCells());
        if (ghosts.cells) ghosts.cellMask = 0xff;
    }
    return ghosts;
}

void copyPoints(const std::string& path, vtkDataSet* data, const Execution& execution,
                std::vector<Vec3d>& points) {
    const vtkIdType count = data->GetNumberOfPoints();
    if (count > std::numeric_limits<std::int32_t>::max())
        throw InputError(path + ": has " + std::to_string(count) + " nodes; at most 2147483647 are possible");
    resizeLarge(points, std::size_t(count));
    auto* set = vtkPointSet::SafeDownCast(data);
    vtkDataArray* array = set && set->GetPoints() ? set->GetPoints()->GetData() : nullptr;
    if (set && count > 0 && (!array || array->GetNumberOfComponents() != 3))
        throw InputError(path + ": points need 3 coordinates");
    const auto copyFrom = [&](const auto* values) {
        parallelForChunks(execution, count, kConvertChunk, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i)
                points[std::size_t(i)] = {double(values[3 * i]), double(values[3 * i + 1]),
                                          double(values[3 * i + 2])};
        });
    };
    if (array && array->HasStandardMemoryLayout() && array->GetDataType() == VTK_DOUBLE)
        copyFrom(static_cast<const double*>(array->GetVoidPointer(0)));
    else if (array && array->HasStandardMemoryLayout() && array->GetDataType() == VTK_FLOAT)
        copyFrom(static_cast<const float*>(array->GetVoidPointer(0)));
    else
        for (vtkIdType i = 0; i < count; ++i) data->GetPoint(i, &points[std::size_t(i)].x);
}

void copyValues(vtkDataArray* array, const Execution& execution, std::vector<double>& values) {
    const vtkIdType count = array->GetNumberOfValues();
    const int components = array->GetNumberOfComponents();
    resizeLarge(values, std::size_t(count));
    const auto copyFrom = [&](const auto* source) {
        parallelForChunks(execution, count, kConvertChunk, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i) values[std::size_t(i)] = double(source[i]);
        });
    };
    if (array->HasStandardMemoryLayout()) {
        switch (array->GetDataType()) {
            vtkTemplateMacro(copyFrom(static_cast<const VTK_TT*>(array->GetVoidPointer(0))); return );
        }
    }
    for (vtkIdType i = 0; i < count; ++i)
        values[std::size_t(i)] = array->GetComponent(i / components, int(i % components));
}

/// Bookkeeping of readers and filters, not data.
bool isInternalName(const std::string& name) {
    return name.size() > 3 && name.starts_with("vtk") && name[3] >= 'A' && name[3] <= 'Z';
}

void copyFields(const std::string& path, vtkDataSetAttributes* attributes, FieldLocation location,
                vtkIdType items, const ReadOptions& options, const Execution& execution, RawBlock& block) {
    std::set<std::string> seen;
    for (int a = 0; a < attributes->GetNumberOfArrays(); ++a) {
        vtkAbstractArray* abstract = attributes->GetAbstractArray(a);
        if (!abstract) continue;
        std::string name = plainName(abstract->GetName() ? abstract->GetName() : "");
        if (isInternalName(name)) continue;
        if (name.empty())
            name =
                (location == FieldLocation::point ? "point_field_" : "cell_field_") + std::to_string(a + 1);
        if (!seen.insert(name).second) continue;  // VTK's attributes hold one array of a name
        auto* array = vtkDataArray::SafeDownCast(abstract);
        block.arrays.push_back({name, location, abstract->GetNumberOfComponents(), array != nullptr});
        if (abstract->GetNumberOfTuples() != items)
            throw InputError(path + ": field '" + name + "' has " +
                             std::to_string(abstract->GetNumberOfTuples()) + " values for " +
                             std::to_string(items) +
                             (location == FieldLocation::point ? " points" : " cells"));
        if (!array || !isWanted(options, name, location)) continue;
        if (array->GetNumberOfComponents() < 1 || array->GetNumberOfComponents() > 9) continue;
        Field field{name, location, array->GetNumberOfComponents(), {}};
        copyValues(array, execution, field.values);
        block.fields.push_back(std::move(field));
    }
}

/// Takes the array out of the attributes, so that it is no field.
void takeNodeIds(vtkDataSetAttributes* attributes, const std::string& name, RawBlock& block) {
    if (name.empty()) return;
    vtkDataArray* ids = attributes->GetArray(name.c_str());
    if (!ids || ids->GetNumberOfComponents() != 1 ||
        ids->GetNumberOfTuples() != vtkIdType(block.points.size()))
        return;
    block.nodeIds.resize(block.points.size());
    for (std::size_t i = 0; i < block.nodeIds.size(); ++i)
        block.nodeIds[i] = std::int64_t(ids->GetComponent(vtkIdType(i), 0));
    attributes->RemoveArray(name.c_str());
}

struct ChunkCounts {
    std::int64_t cells = 0, nodes = 0, skipped = 0, blanked = 0, higherOrder = 0;
    std::int64_t bad = -1;  // first cell that is damaged
};

/// Reads cells of a vtkUnstructuredGrid with offsets and connectivity of type Id.
template <class Id>
class UnstructuredCells {
  public:
    UnstructuredCells(const std::string& path, vtkUnstructuredGrid* grid, const Ghosts& ghosts)
        : path_(path),
          ghosts_(ghosts),
          cellCount_(grid->GetNumberOfCells()),
          pointCount_(grid->GetNumberOfPoints()) {
        vtkCellArray* cells = grid->GetCells();
        offsets_ = static_cast<const Id*>(cells->GetOffsetsArray()->GetVoidPointer(0));
        nodes_ = static_cast<const Id*>(cells->GetConnectivityArray()->GetVoidPointer(0));
        nodeCount_ = cells->GetConnectivityArray()->GetNumberOfValues();
        types_ = grid->GetCellTypesArray()->GetPointer(0);
        if (grid->GetCellTypesArray()->GetNumberOfValues() != cellCount_ ||
            cells->GetOffsetsArray()->GetNumberOfValues() != cellCount_ + 1)
            throw InputError(path + ": the numbers of cells, cell types and cell offsets differ");
        if (vtkIdTypeArray* faces = grid->GetFaces()) {
            faces_ = faces->GetPointer(0);
            faceValues_ = faces->GetNumberOfValues();
        }
        vtkIdTypeArray* places = grid->GetFaceLocations();
        if (places && places->GetNumberOfValues() == cellCount_) facePlaces_ = places->GetPointer(0);
    }

    void read(RawBlock& block, ImportStatistics& statistics, const Execution& execution) const {
        const std::int64_t chunks = (cellCount_ + kConvertChunk - 1) / kConvertChunk;
        std::vector<ChunkCounts> counts{std::size_t(chunks)};
        parallelFor(execution, chunks, [&](std::int64_t k) { counts[std::size_t(k)] = count(k); });
        std::vector<std::int64_t> cellBase, nodeBase;
        std::int64_t cells = 0, nodes = 0;
        for (const ChunkCounts& c : counts) {
            if (c.bad >= 0) throw InputError(path_ + ": " + complaint(c.bad));
            cellBase.push_back(cells);
            nodeBase.push_back(nodes);
            cells += c.cells;
            nodes += c.nodes;
            statistics.skippedCells += c.skipped;
            statistics.blankedCells += c.blanked;
            statistics.higherOrderCells += c.higherOrder;
        }
        block.cells.kinds.resize(std::size_t(cells));
        block.cells.begin.resize(std::size_t(cells) + 1);
        block.cells.nodes.resize(std::size_t(nodes));
        block.cells.begin[std::size_t(cells)] = nodes;
        if (cells != cellCount_) block.sourceCell.resize(std::size_t(cells));
        parallelFor(execution, chunks, [&](std::int64_t k) {
            fill(k, std::size_t(cellBase[std::size_t(k)]), nodeBase[std::size_t(k)], block);
        });
    }

  private:
    /// Empty when the cell is sound.
    std::string complaint(std::int64_t c) const {
        const CellRule rule = ruleOf(types_[c]);
        const std::string name = "cell " + std::to_string(c) + " (counted from 0)";
        const auto begin = std::int64_t(offsets_[c]), end = std::int64_t(offsets_[c + 1]);
        if (begin < 0 || begin > end || end > nodeCount_)
            return name + " has nodes " + std::to_string(begin) + " to " + std::to_string(end) +
                   " of a list of " + std::to_string(nodeCount_);
        if (!rule.solid) return {};
        if (end - begin < rule.corners)
            return name + " has " + std::to_string(end - begin) + " nodes, its type needs " +
                   std::to_string(rule.corners);
        std::string wrong;
        const auto checkNode = [&](std::int64_t node) {
            if (wrong.empty() && (node < 0 || node >= pointCount_))
                wrong = name + " has node index " + std::to_string(node) + ", there are " +
                        std::to_string(pointCount_) + " points";
        };
        for (int i = 0; i < rule.corners; ++i) checkNode(std::int64_t(nodes_[begin + i]));
        if (types_[c] != VTK_POLYHEDRON || !wrong.empty()) return wrong;
        const std::int64_t place = facePlaces_ ? facePlaces_[c] : -1;
        if (place < 0 || place >= faceValues_) return name + " is a polyhedron without faces";
        std::int64_t at = place + 1;
        for (std::int64_t f = 0; f < faces_[place]; ++f) {
            const std::int64_t count = at < faceValues_ ? faces_[at] : -1;
            if (count < 0 || count > faceValues_ - at - 1) return name + " has a damaged list of faces";
            for (std::int64_t i = 1; i <= count; ++i) checkNode(faces_[at + i]);
            at += 1 + count;
        }
        if (faces_[place] < 0) return name + " has a damaged list of faces";
        return wrong;
    }

    bool isSound(std::int64_t c, const CellRule& rule) const {
        const auto begin = std::int64_t(offsets_[c]), end = std::int64_t(offsets_[c + 1]);
        if (begin < 0 || begin > end || end > nodeCount_) return false;
        if (rule.kind == CellKind::polyhedron) return complaint(c).empty();
        if (end - begin < rule.corners) return false;
        for (int i = 0; i < rule.corners; ++i)
            if (nodes_[begin + i] < 0 || std::int64_t(nodes_[begin + i]) >= pointCount_) return false;
        return true;
    }

    bool isBlanked(std::int64_t c) const {
        if (ghosts_.hidesCell(c)) return true;
        if (!ghosts_.points) return false;
        for (auto i = std::int64_t(offsets_[c]); i < std::int64_t(offsets_[c + 1]); ++i) {
            const auto node = std::int64_t(nodes_[i]);
            if (node >= 0 && node < pointCount_ && ghosts_.hidesPoint(node)) return true;
        }
        return false;
    }

    std::int64_t streamLength(std::int64_t c) const {
        if (types_[c] == VTK_PENTAGONAL_PRISM) return 1 + 2 * 6 + 5 * 5;
        if (types_[c] == VTK_HEXAGONAL_PRISM) return 1 + 2 * 7 + 6 * 5;
        std::int64_t at = facePlaces_[c] + 1;
        for (std::int64_t f = 0; f < faces_[facePlaces_[c]]; ++f) at += 1 + faces_[at];
        return at - facePlaces_[c];
    }

    void writeStream(std::int64_t c, std::int32_t* out) const {
        if (types_[c] == VTK_POLYHEDRON) {
            const std::int64_t length = streamLength(c);
            for (std::int64_t i = 0; i < length; ++i) out[i] = std::int32_t(faces_[facePlaces_[c] + i]);
            return;
        }
        const int sides = types_[c] == VTK_PENTAGONAL_PRISM ? 5 : 6;
        const Id* node = nodes_ + offsets_[c];
        *out++ = sides + 2;
        *out++ = sides;
        for (int i = sides; i-- > 0;) *out++ = std::int32_t(node[i]);
        *out++ = sides;
        for (int i = 0; i < sides; ++i) *out++ = std::int32_t(node[sides + i]);
        for (int i = 0; i < sides; ++i) {
            const int j = (i + 1) % sides;
            *out++ = 4;
            for (const int k : {i, j, sides + j, sides + i}) *out++ = std::int32_t(node[k]);
        }
    }

    ChunkCounts count(std::int64_t chunk) const {
        ChunkCounts counts;
        const std::int64_t end = std::min(cellCount_, (chunk + 1) * kConvertChunk);
        for (std::int64_t c = chunk * kConvertChunk; c < end; ++c) {
            const CellRule rule = ruleOf(types_[c]);
            if (!isSound(c, rule)) {
                counts.bad = c;
                return counts;
            }
            if (!rule.solid) {
                ++counts.skipped;
                continue;
            }
            if (isBlanked(c)) {
                ++counts.blanked;
                continue;
            }
            ++counts.cells;
            counts.nodes += rule.kind == CellKind::polyhedron ? streamLength(c) : rule.corners;
            counts.higherOrder += rule.higherOrder;
        }
        return counts;
    }

    void fill(std::int64_t chunk, std::size_t cell, std::int64_t node, RawBlock& block) const {
        const std::int64_t end = std::min(cellCount_, (chunk + 1) * kConvertChunk);
        for (std::int64_t c = chunk * kConvertChunk; c < end; ++c) {
            const CellRule rule = ruleOf(types_[c]);
            if (!rule.solid || isBlanked(c)) continue;
            block.cells.kinds[cell] = rule.kind;
            block.cells.begin[cell] = node;
            if (!block.sourceCell.empty()) block.sourceCell[cell] = c;
            ++cell;
            if (rule.kind == CellKind::polyhedron) {
                writeStream(c, block.cells.nodes.data() + node);
                node += streamLength(c);
                continue;
            }
            for (int i = 0; i < rule.corners; ++i)
                block.cells.nodes[std::size_t(node++)] = std::int32_t(nodes_[std::int64_t(offsets_[c]) + i]);
        }
    }

    const std::string& path_;
    const Ghosts& ghosts_;
    std::int64_t cellCount_, pointCount_;
    const Id* offsets_ = nullptr;
    const Id* nodes_ = nullptr;
    std::int64_t nodeCount_ = 0;
    const unsigned char* types_ = nullptr;
    const vtkIdType* faces_ = nullptr;
    std::int64_t faceValues_ = 0;
    const vtkIdType* facePlaces_ = nullptr;
};

void readUnstructured(const std::string& path, vtkUnstructuredGrid* grid, const Execution& execution,
                      RawBlock& block, ImportStatistics& statistics) {
    if (grid->GetNumberOfCells() == 0) return;
    const Ghosts ghosts = ghostsOf(grid);
    if (grid->GetCells()->IsStorage64Bit())
        UnstructuredCells<vtkTypeInt64>(path, grid, ghosts).read(block, statistics, execution);
    else
        UnstructuredCells<vtkTypeInt32>(path, grid, ghosts).read(block, statistics, execution);
}

/// Hexahedra of a grid with i running fastest.
template <class IsVisible>
void readStructured(const int dimensions[3], const IsVisible& isVisible, RawBlock& block,
                    ImportStatistics& statistics) {
    const std::int64_t nx = dimensions[0], ny = dimensions[1], nz = dimensions[2];
    if (nx < 2 || ny < 2 || nz < 2) {
        statistics.skippedCells += block.sourceCells;
        return;
    }
    std::int64_t cell = 0;
    for (std::int64_t k = 0; k + 1 < nz; ++k) {
        for (std::int64_t j = 0; j + 1 < ny; ++j) {
            for (std::int64_t i = 0; i + 1 < nx; ++i, ++cell) {
                if (!isVisible(cell)) {
                    ++statistics.blankedCells;
                    continue;
                }
                const auto first = std::int32_t((k * ny + j) * nx + i);
                const auto row = std::int32_t(nx), layer = std::int32_t(nx * ny);
                const std::int32_t nodes[8] = {
                    first,         first + 1,         first + row + 1,         first + row,
                    first + layer, first + layer + 1, first + layer + row + 1, first + layer + row};
                block.cells.add(CellKind::hex, nodes, 8);
                block.sourceCell.push_back(cell);
            }
        }
    }
}

template <class Grid>
void readStructured(const std::string& path, Grid* grid, RawBlock& block, ImportStatistics& statistics) {
    int dimensions[3];
    grid->GetDimensions(dimensions);
    const std::int64_t points = std::int64_t(dimensions[0]) * dimensions[1] * dimensions[2];
    if (points != grid->GetNumberOfPoints() || points > std::numeric_limits<std::int32_t>::max())
        throw InputError(path + ": a grid of " + std::to_string(dimensions[0]) + " x " +
                         std::to_string(dimensions[1]) + " x " + std::to_string(dimensions[2]) +
                         " points has " + std::to_string(grid->GetNumberOfPoints()) + " points");
    const Ghosts ghosts = ghostsOf(grid);
    const bool blanked = grid->HasAnyBlankCells() || grid->HasAnyBlankPoints();
    readStructured(
        dimensions,
        [&](std::int64_t cell) { return !ghosts.hidesCell(cell) && (!blanked || grid->IsCellVisible(cell)); },
        block, statistics);
}

void appendDataSet(const std::string& path, vtkDataSet* data, const std::string& nodeIds,
                   const ReadOptions& options, const Execution& execution, RawMesh& raw) {
    RawBlock block;
    block.sourceCells = data->GetNumberOfCells();
    if (auto* unstructured = vtkUnstructuredGrid::SafeDownCast(data))
        readUnstructured(path, unstructured, execution, block, raw.statistics);
    else if (auto* structured = vtkStructuredGrid::SafeDownCast(data))
        readStructured(path, structured, block, raw.statistics);
    else if (auto* rectilinear = vtkRectilinearGrid::SafeDownCast(data))
        readStructured(path, rectilinear, block, raw.statistics);
    else if (auto* image = vtkImageData::SafeDownCast(data))
        readStructured(path, image, block, raw.statistics);
    else
        raw.statistics.skippedCells += data->GetNumberOfCells();
    if (block.cells.kinds.empty()) return;
    copyPoints(path, data, execution, block.points);
    takeNodeIds(data->GetPointData(), nodeIds, block);
    copyFields(path, data->GetPointData(), FieldLocation::point, data->GetNumberOfPoints(), options,
               execution, block);
    copyFields(path, data->GetCellData(), FieldLocation::cell, data->GetNumberOfCells(), options, execution,
               block);
    raw.blocks.push_back(std::move(block));
}

/// Corners of a 2D cell in order; none for other cells.
void appendPolygon(const std::string& path, int type, std::span<const vtkIdType> nodes, RawSurface& raw,
                   std::int64_t cell, std::vector<std::int64_t>& sources) {
    const auto add = [&](std::initializer_list<std::size_t> order) {
        for (const std::size_t i : order) raw.corners.push_back(std::int32_t(nodes[i]));
        raw.endPolygon();
        sources.push_back(cell);
    };
    switch (type) {
        case VTK_TRIANGLE:
        case VTK_QUADRATIC_TRIANGLE:
            if (nodes.size() >= 3) add({0, 1, 2});
            break;
        case VTK_PIXEL:
            if (nodes.size() == 4) add({0, 1, 3, 2});
            break;
        case VTK_QUAD:
        case VTK_QUADRATIC_QUAD:
            if (nodes.size() >= 4) add({0, 1, 2, 3});
            break;
        case VTK_POLYGON:
            if (nodes.size() < 3) break;
            for (const vtkIdType node : nodes) raw.corners.push_back(std::int32_t(node));
            raw.endPolygon();
            sources.push_back(cell);
            break;
        case VTK_TRIANGLE_STRIP:
            for (std::size_t i = 2; i < nodes.size(); ++i)
                i % 2 == 0 ? add({i - 2, i - 1, i}) : add({i - 1, i - 2, i});
            break;
        case VTK_EMPTY_CELL:
        case VTK_VERTEX:
        case VTK_POLY_VERTEX:
        case VTK_LINE:
        case VTK_POLY_LINE:
            break;
        default:
            throw InputError(path + ": cell " + std::to_string(cell) + " is of VTK's type " +
                             std::to_string(type) + ", which isn't read as part of a surface");
    }
}

}  // namespace

void appendVtkData(const std::string& path, vtkDataObject* data, const std::string& nodeIds,
                   const ReadOptions& options, const Execution& execution, RawMesh& raw) {
    if (auto* set = vtkDataSet::SafeDownCast(data)) {
        appendDataSet(path, set, nodeIds, options, execution, raw);
        return;
    }
    auto* composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) return;
    const auto iterator = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (iterator->InitTraversal(); !iterator->IsDoneWithTraversal(); iterator->GoToNextItem()) {
        execution.throwIfCancelled();
        if (auto* set = vtkDataSet::SafeDownCast(iterator->GetCurrentDataObject()))
            appendDataSet(path, set, nodeIds, options, execution, raw);
    }
}

RawSurface surfaceOf(const std::string& path, vtkDataObject* data, const ReadOptions& options,
                     const Execution& execution) {
    auto* set = vtkPointSet::SafeDownCast(data);
    if (!set || vtkStructuredGrid::SafeDownCast(data))
        throw InputError(path + ": holds no surface and no points of their own");
    RawSurface raw;
    copyPoints(path, set, execution, raw.points);
    const Ghosts ghosts = ghostsOf(set);
    std::vector<std::int64_t> sources;  // the cell of every polygon
    bool hasLines = false;
    std::int64_t higherOrder = 0;
    vtkNew<vtkIdList> nodes;
    for (vtkIdType c = 0; c < set->GetNumberOfCells(); ++c) {
        const int type = set->GetCellType(c);
        if (ruleOf(type).solid)
            throw InputError(path + ": holds 3D cells already, cell " + std::to_string(c) +
                             " for one: tessera itself reads such files");
        set->GetCellPoints(c, nodes);
        const std::span<const vtkIdType> ids(nodes->GetPointer(0), std::size_t(nodes->GetNumberOfIds()));
        for (const vtkIdType node : ids)
            if (node < 0 || node >= vtkIdType(raw.points.size()))
                throw InputError(path + ": cell " + std::to_string(c) + " names node " +
                                 std::to_string(node) + ", out of range 0 to " +
                                 std::to_string(std::int64_t(raw.points.size()) - 1));
        if (!ghosts.hidesCell(c)) appendPolygon(path, type, ids, raw, c, sources);
        higherOrder += type == VTK_QUADRATIC_TRIANGLE || type == VTK_QUADRATIC_QUAD;
        hasLines |= type == VTK_LINE || type == VTK_POLY_LINE;
    }
    if (raw.polygonCount() == 0 && hasLines)
        throw InputError(path +
                         ": holds lines and no triangles; tetrahedra are made of closed surfaces or points");
    if (higherOrder > 0)
        raw.warnings.push_back(std::to_string(higherOrder) +
                               " cells of higher order are read by their corners, as flat ones.");
    if (raw.polygonCount() == 0 && set->GetCellData()->GetNumberOfArrays() > 0)
        raw.warnings.push_back("Fields of cells are left out: there are no triangles.");
    RawBlock block;
    copyFields(path, set->GetPointData(), FieldLocation::point, set->GetNumberOfPoints(), options, execution,
               block);
    if (raw.polygonCount() > 0)
        copyFields(path, set->GetCellData(), FieldLocation::cell, set->GetNumberOfCells(), options, execution,
                   block);
    for (Field& field : block.fields) {
        if (field.location == FieldLocation::cell) {
            std::vector<double> values;
            for (const std::int64_t cell : sources)
                for (int k = 0; k < field.components; ++k) values.push_back(field.at(cell, k));
            field.values = std::move(values);
        }
        raw.fields.push_back(std::move(field));
    }
    return raw;
}

}  // namespace tessera
