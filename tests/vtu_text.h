#pragma once

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "tessera/vec.h"

namespace tessera::test {

/// The bytes of numbers, as this machine has them.
template <class Stored, class Values>
std::string bytesOf(const Values& values) {
    std::string bytes;
    for (const auto value : values) {
        const auto stored = Stored(value);
        bytes.append(reinterpret_cast<const char*>(&stored), sizeof stored);
    }
    return bytes;
}

/// An ASCII .vtu file in the making.
struct VtuText {
    struct Cell {
        int type;
        std::vector<int> nodes;
    };
    struct Array {
        std::string name, type;
        int components;
        std::string values;
    };
    std::vector<Vec3d> points;
    std::vector<Cell> cells;
    std::vector<Array> pointArrays, cellArrays;
    std::string faces, faceOffsets;

    static std::string numbers(int count) {
        std::string text;
        for (int i = 0; i < count; ++i) text += std::to_string(i) + " ";
        return text;
    }

    static std::string number(double x) {
        char buffer[40];
        std::snprintf(buffer, sizeof buffer, "%.17g", x);
        return std::isnan(x) ? "nan" : buffer;
    }

    static std::string array(const Array& a) {
        return "<DataArray type=\"" + a.type + "\" Name=\"" + a.name + "\" NumberOfComponents=\"" +
               std::to_string(a.components) + "\" format=\"ascii\">\n" + a.values + "\n</DataArray>\n";
    }

    std::string text() const {
        std::string coordinates, connectivity, offsets, types;
        for (const Vec3d& p : points)
            coordinates += number(p.x) + " " + number(p.y) + " " + number(p.z) + "\n";
        std::size_t offset = 0;
        for (const Cell& cell : cells) {
            for (const int node : cell.nodes) connectivity += std::to_string(node) + " ";
            offsets += std::to_string(offset += cell.nodes.size()) + " ";
            types += std::to_string(cell.type) + " ";
        }
        std::string result =
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
            "byte_order=\"LittleEndian\" "
            "header_type=\"UInt64\">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"" +
            std::to_string(points.size()) + "\" NumberOfCells=\"" + std::to_string(cells.size()) +
            "\">\n<PointData>\n";
        for (const Array& a : pointArrays) result += array(a);
        result += "</PointData>\n<CellData>\n";
        for (const Array& a : cellArrays) result += array(a);
        result += "</CellData>\n<Points>\n" + array({"Points", "Float64", 3, coordinates}) +
                  "</Points>\n<Cells>\n" + array({"connectivity", "Int64", 1, connectivity}) +
                  array({"offsets", "Int64", 1, offsets}) + array({"types", "UInt8", 1, types});
        if (!faces.empty())
            result += array({"faces", "Int64", 1, faces}) + array({"faceoffsets", "Int64", 1, faceOffsets});
        return result + "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
    }
};

}  // namespace tessera::test
