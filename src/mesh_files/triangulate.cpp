#include "mesh_files/triangulate.h"

#include <vtkCellArray.h>
#include <vtkContourTriangulator.h>
#include <vtkIdList.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolygon.h>

#include "mesh_files/vtk_messages.h"

namespace tessera {

namespace {

/// Ears are cut off where all corners lie in a plane, nearly.
bool cutEars(const std::vector<Vec3d>& points, std::span<const std::int32_t> corners,
             std::vector<std::array<std::int32_t, 3>>& triangles) {
    const auto count = vtkIdType(corners.size());
    vtkNew<vtkPolygon> polygon;
    polygon->GetPointIds()->SetNumberOfIds(count);
    polygon->GetPoints()->SetDataType(VTK_DOUBLE);
    polygon->GetPoints()->SetNumberOfPoints(count);
    for (vtkIdType i = 0; i < count; ++i) {
        polygon->GetPointIds()->SetId(i, i);
        polygon->GetPoints()->SetPoint(i, &points[std::size_t(corners[std::size_t(i)])].x);
    }
    vtkNew<vtkIdList> cut;
    if (!polygon->Triangulate(cut) || cut->GetNumberOfIds() != 3 * (count - 2)) return false;
    const auto corner = [&](vtkIdType i) { return corners[std::size_t(cut->GetId(i))]; };
    for (vtkIdType i = 0; i < cut->GetNumberOfIds(); i += 3)
        triangles.push_back({corner(i), corner(i + 1), corner(i + 2)});
    return true;
}

}  // namespace

std::vector<std::array<std::int32_t, 3>> trianglesOf(const std::string& path, const RawSurface& raw,
                                                     std::vector<std::int64_t>& sources) {
    const VtkMessages messages;  // of polygons that can't be split
    std::vector<std::array<std::int32_t, 3>> triangles;
    for (std::int64_t p = 0; p < raw.polygonCount(); ++p) {
        const std::span<const std::int32_t> corners = raw.polygon(p);
        if (corners.size() == 3)
            triangles.push_back({corners[0], corners[1], corners[2]});
        else if (!cutEars(raw.points, corners, triangles))
            throw InputError(path + ": polygon " + std::to_string(p) + " (counted from 0) of " +
                             std::to_string(corners.size()) +
                             " corners can't be split into triangles: it crosses itself or has no area");
        sources.resize(triangles.size(), p);
    }
    return triangles;
}

std::vector<std::array<std::int32_t, 3>> trianglesOfFacet(const std::vector<Vec3d>& points,
                                                          std::span<const std::vector<std::int32_t>> loops) {
    const VtkMessages messages;
    vtkNew<vtkPoints> places;
    places->SetDataType(VTK_DOUBLE);
    vtkNew<vtkCellArray> lines;
    std::vector<std::int32_t> corners;
    for (const std::vector<std::int32_t>& loop : loops) {
        vtkNew<vtkIdList> line;
        for (const std::int32_t corner : loop) {
            line->InsertNextId(places->InsertNextPoint(&points[std::size_t(corner)].x));
            corners.push_back(corner);
        }
        line->InsertNextId(line->GetId(0));
        lines->InsertNextCell(line);
    }
    vtkNew<vtkPolyData> outline;
    outline->SetPoints(places);
    outline->SetLines(lines);
    vtkNew<vtkContourTriangulator> triangulator;
    triangulator->SetInputData(outline);
    triangulator->Update();
    std::vector<std::array<std::int32_t, 3>> triangles;
    if (triangulator->GetTriangulationError()) return triangles;
    vtkCellArray* polygons = triangulator->GetOutput()->GetPolys();
    for (vtkIdType t = 0; t < polygons->GetNumberOfCells(); ++t) {
        vtkNew<vtkIdList> cell;
        polygons->GetCellAtId(t, cell);
        if (cell->GetNumberOfIds() != 3) return {};
        std::array<std::int32_t, 3>& triangle = triangles.emplace_back();
        for (std::size_t i = 0; i < 3; ++i) {
            const vtkIdType point = cell->GetId(vtkIdType(i));
            if (point < 0 || point >= vtkIdType(corners.size())) return {};
            triangle[i] = corners[std::size_t(point)];
        }
    }
    return triangles;
}

}  // namespace tessera
