#include "graded_points.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>

#include "files/atomic_file.h"
#include "options.h"
#include "reference/generators.h"
#include "tessera/error.h"

namespace tessera {

namespace {
constexpr std::string_view kPrefix = "graded:";
constexpr double kPower = 2.2;
constexpr std::uint64_t kSeed = 20011024;
}  // namespace

std::optional<std::int64_t> gradedPointCount(const std::string& input) {
    if (!input.starts_with(kPrefix)) return std::nullopt;
    const std::int64_t count = parseCount("graded:N", input.substr(kPrefix.size()), false);
    if (count < 1 || count > 100'000'000) throw InputError("graded:N takes 1 to 100M points");
    return count;
}

void writeGradedPoints(const std::string& path, std::int64_t count) {
    std::vector<Vec3d> points;
    for (int corner = 0; corner < 8; ++corner)
        points.emplace_back(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
    const std::vector<Vec3d> inner = gradedPoints(int(count), kPower, kSeed);
    points.insert(points.end(), inner.begin(), inner.end());
    std::string text = "x,y,z,f\n";
    for (const Vec3d& p : points)
        fmt::format_to(std::back_inserter(text), "{},{},{},{}\n", p.x, p.y, p.z,
                       std::sin(9 * p.x) * std::cos(7 * p.y) + p.z * p.z);
    writeFileAtomically(path, text);
}

}  // namespace tessera
