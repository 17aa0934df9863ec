#include "surface/extend_fields.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "mesh/element_class.h"
#include "mesh/field_range.h"

namespace tessera {

namespace {

constexpr int kMostRounds = 2000;
constexpr double kEnough = 1e-12;  // of the residual at the start

/// Rows of the stiffness matrix of Laplace's equation: for every node its neighbours and their weights, which
/// sum up to 0 with its own.
class Stiffness {
  public:
    explicit Stiffness(const TetMesh& mesh) {
        std::vector<Entry> entries;
        entries.reserve(mesh.tets.size() * 12);
        for (std::int64_t e = 0; e < mesh.elementCount(); ++e) addElement(mesh, e, entries);
        std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
            return a.row != b.row ? a.row < b.row : a.column < b.column;
        });
        begins_.assign(mesh.points.size() + 1, 0);
        for (const Entry& entry : entries) {
            if (!columns_.empty() && lastRow_ == entry.row && columns_.back() == entry.column) {
                weights_.back() += entry.weight;
                continue;
            }
            lastRow_ = entry.row;
            columns_.push_back(entry.column);
            weights_.push_back(entry.weight);
            begins_[std::size_t(entry.row) + 1] = columns_.size();
        }
        for (std::size_t n = 1; n < begins_.size(); ++n) begins_[n] = std::max(begins_[n], begins_[n - 1]);
    }

    /// Sum of weight (u[node] - u[other]).
    double row(std::size_t node, const std::vector<double>& u) const {
        double sum = 0;
        for (std::size_t k = begins_[node]; k < begins_[node + 1]; ++k)
            sum += weights_[k] * (u[node] - u[std::size_t(columns_[k])]);
        return sum;
    }
    double diagonal(std::size_t node) const {
        double sum = 0;
        for (std::size_t k = begins_[node]; k < begins_[node + 1]; ++k) sum += weights_[k];
        return sum;
    }

  private:
    struct Entry {
        std::int32_t row, column;
        double weight;
    };

    static void addElement(const TetMesh& mesh, std::int64_t element, std::vector<Entry>& entries) {
        const Corners p = cornersOf(mesh, element);
        const double sixfold = std::abs(glm::dot(glm::cross(p[1] - p[0], p[2] - p[0]), p[3] - p[0]));
        if (!(sixfold > 0)) return;
        // Normals of the faces opposite each corner, inwards, as long as twice their areas.
        std::array<Vec3d, 4> normals{
            glm::cross(p[3] - p[1], p[2] - p[1]), glm::cross(p[2] - p[0], p[3] - p[0]),
            glm::cross(p[3] - p[0], p[1] - p[0]), glm::cross(p[1] - p[0], p[2] - p[0])};
        const auto& nodes = mesh.tets[std::size_t(element)];
        for (std::size_t i = 0; i < 4; ++i)
            for (std::size_t j = 0; j < i; ++j) {
                const double weight = -glm::dot(normals[i], normals[j]) / (6 * sixfold);
                entries.push_back({nodes[i], nodes[j], weight});
                entries.push_back({nodes[j], nodes[i], weight});
            }
    }

    std::vector<std::size_t> begins_;
    std::vector<std::int32_t> columns_;
    std::vector<double> weights_;
    std::int32_t lastRow_ = -1;
};

double dot(const std::vector<std::size_t>& nodes, const std::vector<double>& a,
           const std::vector<double>& b) {
    double sum = 0;
    for (const std::size_t n : nodes) sum += a[n] * b[n];
    return sum;
}

/// Conjugate gradients with the diagonal as preconditioner. @param u has what is known and a first guess.
void solve(const Stiffness& stiffness, const std::vector<std::size_t>& unknown, std::vector<double>& u) {
    std::vector<double> residual(u.size()), preconditioned(u.size()), direction(u.size()), image(u.size());
    std::vector<double> diagonal(u.size());
    for (const std::size_t n : unknown) {
        const double own = stiffness.diagonal(n);
        diagonal[n] = own > 0 ? own : 1;
        residual[n] = -stiffness.row(n, u);
        preconditioned[n] = residual[n] / diagonal[n];
        direction[n] = preconditioned[n];
    }
    double product = dot(unknown, residual, preconditioned);
    const double enough = product * kEnough * kEnough;
    for (int round = 0; round < kMostRounds && product > enough; ++round) {
        for (const std::size_t n : unknown) image[n] = stiffness.row(n, direction);
        const double curvature = dot(unknown, direction, image);
        if (!(curvature > 0)) return;
        const double step = product / curvature;
        for (const std::size_t n : unknown) {
            u[n] += step * direction[n];
            residual[n] -= step * image[n];
            preconditioned[n] = residual[n] / diagonal[n];
        }
        const double next = dot(unknown, residual, preconditioned);
        for (const std::size_t n : unknown) direction[n] = preconditioned[n] + next / product * direction[n];
        product = next;
    }
}

}  // namespace

void extendFields(TetMesh& mesh, const std::vector<char>& isKnown) {
    if (mesh.fields.empty() || std::find(isKnown.begin(), isKnown.end(), 0) == isKnown.end()) return;
    const Stiffness stiffness(mesh);
    for (Field& field : mesh.fields) {
        if (field.location != FieldLocation::point) continue;
        const auto components = std::size_t(field.components);
        for (std::size_t c = 0; c < components; ++c) {
            std::vector<double> u(isKnown.size());
            std::vector<std::size_t> unknown;
            ValueRange range;
            double sum = 0, count = 0;
            for (std::size_t n = 0; n < u.size(); ++n) {
                const double value = field.values[n * components + c];
                if (!isKnown[n] || !std::isfinite(value)) {
                    unknown.push_back(n);
                    continue;
                }
                u[n] = value;
                range.min = std::min(range.min, value);
                range.max = std::max(range.max, value);
                sum += value, ++count;
            }
            for (const std::size_t n : unknown) u[n] = sum / count;
            if (count > 0) solve(stiffness, unknown, u);
            for (const std::size_t n : unknown)
                if (!isKnown[n])
                    field.values[n * components + c] = count > 0 ? std::clamp(u[n], range.min, range.max)
                                                                 : std::numeric_limits<double>::quiet_NaN();
        }
    }
}

}  // namespace tessera
