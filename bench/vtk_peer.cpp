// vtkResampleToImage as a peer of `tessera bench`: tessera-vtk-peer MESH.vtu, see docs/benchmark_peers.md.
// Apart from the rest because VTK's thread header is no C++20.

#include <vtkDataArray.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkResampleToImage.h>
#include <vtkSMPTools.h>
#include <vtkUnstructuredGrid.h>
#include <vtkVersion.h>
#include <vtkXMLUnstructuredGridReader.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <exception>
#include <fstream>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using Json = nlohmann::json;

/// Where samples are asked for: origin + i spacing, world units.
struct Points {
    std::array<double, 3> origin, spacing;
    std::array<int, 3> count;

    std::size_t total() const {
        return std::size_t(count[0]) * std::size_t(count[1]) * std::size_t(count[2]);
    }
    /// Points of VTK's image: its spacing along an axis follows from its bounds, so it has two there at
    /// least.
    int imageCount(std::size_t axis) const { return count[axis] > 1 ? count[axis] : 2; }
};

Points pointsOf(const Json& request) {
    Points points{};
    request.at("origin").get_to(points.origin);
    request.at("spacing").get_to(points.spacing);
    request.at("points").get_to(points.count);
    for (std::size_t a = 0; a < 3; ++a)
        if (points.count[a] < 1 || !(points.spacing[a] > 0))
            throw std::runtime_error("expected points and spacings above zero");
    return points;
}

/// The upper bound from which VTK's division by the steps gives the spacing back, to the last bit where some
/// double does: on a mesh's surface rounding decides whether a whole layer of points is in the mesh.
double upperBound(double origin, double spacing, int steps) {
    constexpr int kNeighbours = 8;
    const double rounded = origin + steps * spacing;
    double best = rounded, candidate = rounded;
    for (int n = 0; n < kNeighbours; ++n) candidate = std::nextafter(candidate, origin);
    for (int n = 0; n < 2 * kNeighbours; ++n) {
        const auto distance = [&](double bound) { return std::fabs((bound - origin) / steps - spacing); };
        if (distance(candidate) < distance(best)) best = candidate;
        candidate = std::nextafter(candidate, std::numeric_limits<double>::infinity());
    }
    return best;
}

void placeImage(const Points& points, vtkResampleToImage* filter) {
    std::array<double, 6> bounds{};
    for (std::size_t a = 0; a < 3; ++a) {
        bounds[2 * a] = points.origin[a];
        bounds[2 * a + 1] = upperBound(points.origin[a], points.spacing[a], points.imageCount(a) - 1);
    }
    filter->UseInputBoundsOff();
    filter->SetSamplingBounds(bounds.data());
    filter->SetSamplingDimensions(points.imageCount(0), points.imageCount(1), points.imageCount(2));
}

/// The field's samples, x fastest and components side by side, NaN where VTK's mask has no value.
void appendSamples(vtkImageData* image, const Points& points, const Json& field,
                   std::vector<float>& samples) {
    const std::string name = field.at("name").get<std::string>();
    vtkDataArray* values = image->GetPointData()->GetArray(name.c_str());
    vtkDataArray* mask = image->GetPointData()->GetArray("vtkValidPointMask");
    const int components = field.at("components").get<int>();
    if (!mask) throw std::runtime_error("vtkResampleToImage gave no mask of valid points");
    if (!values || values->GetNumberOfComponents() != components)
        throw std::runtime_error("vtkResampleToImage gave no field " + name + " of " +
                                 std::to_string(components) + " components");
    for (int k = 0; k < points.count[2]; ++k)
        for (int j = 0; j < points.count[1]; ++j)
            for (int i = 0; i < points.count[0]; ++i) {
                const vtkIdType row = vtkIdType(k) * points.imageCount(1) + j;
                const vtkIdType at = row * points.imageCount(0) + i;
                const bool isValid = mask->GetComponent(at, 0) != 0;
                for (int c = 0; c < components; ++c)
                    samples.push_back(isValid ? float(values->GetComponent(at, c))
                                              : std::numeric_limits<float>::quiet_NaN());
            }
}

void writeSamples(const std::vector<float>& samples, const std::string& path) {
    std::ofstream file(path, std::ios::binary);
    file.write(reinterpret_cast<const char*>(samples.data()),
               std::streamsize(samples.size() * sizeof(float)));
    file.close();
    if (!file) throw std::runtime_error("can't write " + path);
}

/// Returns milliseconds of the filter.
double sample(vtkUnstructuredGrid* mesh, const Json& request) {
    const Points points = pointsOf(request);
    vtkSMPTools::Initialize(request.at("threads").get<int>());
    // A new data object a request, so that nothing built on the last one (cell links, locators) is left over.
    vtkNew<vtkUnstructuredGrid> grid;
    grid->DeepCopy(mesh);
    vtkNew<vtkResampleToImage> filter;
    filter->SetInputDataObject(grid);
    placeImage(points, filter);
    const auto start = std::chrono::steady_clock::now();
    filter->Update();
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - start;
    vtkIdType expected = 1;
    for (std::size_t a = 0; a < 3; ++a) expected *= points.imageCount(a);
    if (filter->GetOutput()->GetNumberOfPoints() != expected)
        throw std::runtime_error("vtkResampleToImage gave no samples");
    std::vector<float> samples;
    for (const Json& field : request.at("fields")) {
        samples.reserve(samples.size() + points.total() * field.at("components").get<std::size_t>());
        appendSamples(filter->GetOutput(), points, field, samples);
    }
    writeSamples(samples, request.at("samples").get<std::string>());
    return elapsed.count();
}

Json answer(vtkUnstructuredGrid* mesh, const std::string& line) {
    try {
        return {{"ms", sample(mesh, Json::parse(line))}};
    } catch (const std::exception& error) {
        return {{"error", error.what()}};
    }
}

void say(const Json& line) {
    std::cout << line.dump(-1, ' ', false, Json::error_handler_t::replace) << std::endl;
}

}  // namespace

int main(int count, char** words) {
    if (count != 2) {
        std::cerr << "usage: tessera-vtk-peer MESH.vtu\n";
        return 2;
    }
    vtkSMPTools::SetBackend("TBB");
    vtkNew<vtkXMLUnstructuredGridReader> reader;
    reader->SetFileName(words[1]);
    reader->Update();
    if (reader->GetOutput()->GetNumberOfCells() == 0) {
        std::cerr << "tessera-vtk-peer: " << words[1] << ": VTK read no cells\n";
        return 1;
    }
    say({{"peer", std::string("VTK ") + vtkVersion::GetVTKVersion() + " vtkResampleToImage, " +
                      vtkSMPTools::GetBackend()}});
    for (std::string line; std::getline(std::cin, line);) say(answer(reader->GetOutput(), line));
    return 0;
}
