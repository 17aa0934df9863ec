#include "mesh_files/join_parts.h"

#include <algorithm>
#include <cmath>

#include "mesh/mesh_quality.h"
#include "mesh_files/raw_mesh.h"

namespace tessera {

namespace {

constexpr int kMostTried = 64;  // points at one place that a point is compared with
// Parts may round what they compute in different ways: about a float's resolution, over the component's
// largest value.
constexpr double kSameValue = 1e-7;

/// Finds for every point the one it becomes.
class PartJoiner {
  public:
    PartJoiner(RawBlock& block, const std::vector<std::size_t>& firstPoint, const Execution& execution)
        : firstPoint_(firstPoint), firstAtPlace_(firstNodeAtPlace(block.points, execution)) {
        for (Field& field : block.fields) {
            if (field.location != FieldLocation::point) continue;
            fields_.push_back(&field);
            std::vector<double>& tolerances = tolerances_.emplace_back(std::size_t(field.components), 0.0);
            for (std::size_t v = 0; v < field.values.size(); ++v) {
                double& tolerance = tolerances[v % tolerances.size()];
                if (std::isfinite(field.values[v]))
                    tolerance = std::max(tolerance, kSameValue * std::fabs(field.values[v]));
            }
        }
        becomes_.resize(block.points.size());
        nextAtPlace_.assign(block.points.size(), kNone);
        lastPart_.resize(block.points.size());
    }

    void run() {
        for (std::size_t part = 0; part < firstPoint_.size(); ++part) {
            const std::size_t end = part + 1 < firstPoint_.size() ? firstPoint_[part + 1] : becomes_.size();
            for (std::size_t i = firstPoint_[part]; i < end; ++i) place(std::int32_t(i), std::int32_t(part));
        }
    }

    /// becomes()[i] is i for points that stay.
    const std::vector<std::int32_t>& becomes() const { return becomes_; }
    std::int64_t apart() const { return apart_; }

  private:
    static constexpr std::int32_t kNone = -1;

    /// Every value that is finite in both is the same.
    bool agree(std::int32_t a, std::int32_t b) const {
        for (std::size_t f = 0; f < fields_.size(); ++f)
            for (int c = 0; c < fields_[f]->components; ++c) {
                const double x = fields_[f]->at(a, c), y = fields_[f]->at(b, c);
                if (std::isfinite(x) && std::isfinite(y) &&
                    !(std::fabs(x - y) <= tolerances_[f][std::size_t(c)]))
                    return false;
            }
        return true;
    }

    void join(std::int32_t point, std::int32_t into) {
        becomes_[std::size_t(point)] = into;
        for (Field* field : fields_)
            for (int c = 0; c < field->components; ++c) {
                double& value =
                    field->values[std::size_t(into) * std::size_t(field->components) + std::size_t(c)];
                if (!std::isfinite(value)) value = field->at(point, c);
            }
    }

    /// Takes the first point at the same place that agrees and that no other point of this part took.
    void place(std::int32_t point, std::int32_t part) {
        const std::int32_t first = firstAtPlace_[std::size_t(point)];
        becomes_[std::size_t(point)] = point;
        lastPart_[std::size_t(point)] = part;
        if (first == point) return;
        bool differs = false;
        std::int32_t last = first;
        int tried = 0;
        for (std::int32_t at = first; at != kNone; at = nextAtPlace_[std::size_t(at)]) {
            last = at;
            if (++tried > kMostTried)
                return;  // points all at one place would take the square of their number
            if (lastPart_[std::size_t(at)] == part) continue;
            if (agree(at, point)) {
                lastPart_[std::size_t(at)] = part;
                join(point, at);
                return;
            }
            differs = true;
        }
        nextAtPlace_[std::size_t(last)] = point;
        apart_ += differs;
    }

    const std::vector<std::size_t>& firstPoint_;
    std::vector<std::int32_t> firstAtPlace_, becomes_;
    std::vector<std::int32_t> nextAtPlace_;  // of the points that stay, the next one at the same place
    std::vector<std::int32_t> lastPart_;     // the last part that has a point there
    std::vector<Field*> fields_;
    std::vector<std::vector<double>> tolerances_;  // of every component of each
    std::int64_t apart_ = 0;
};

}  // namespace

JoinedPoints joinParts(RawBlock& block, const std::vector<std::size_t>& firstPoint,
                       const Execution& execution) {
    PartJoiner joiner(block, firstPoint, execution);
    joiner.run();
    const std::vector<std::int32_t>& becomes = joiner.becomes();
    JoinedPoints joined;
    joined.apart = joiner.apart();
    joined.newIndex.resize(becomes.size());
    for (std::size_t i = 0; i < becomes.size(); ++i) {
        if (becomes[i] == std::int32_t(i)) {
            joined.newIndex[i] = std::int32_t(joined.kept.size());
            joined.kept.push_back(std::int32_t(i));
        } else {
            joined.newIndex[i] = joined.newIndex[std::size_t(becomes[i])];  // an earlier point
        }
    }
    return joined;
}

}  // namespace tessera
