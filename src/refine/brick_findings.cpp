#include "refine/brick_findings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "base/check.h"
#include "mesh/geometry.h"
#include "refine/error_bounds.h"

namespace tessera {

namespace {
constexpr double kNone = std::numeric_limits<double>::infinity();
constexpr double kNotFinite = std::numeric_limits<double>::quiet_NaN();

bool isFlat(const TetMesh& mesh, std::int32_t element) {
    const auto& tet = mesh.tets[std::size_t(element)];
    return volumeSign(mesh.points[std::size_t(tet[0])], mesh.points[std::size_t(tet[1])],
                      mesh.points[std::size_t(tet[2])], mesh.points[std::size_t(tet[3])]) == 0;
}
}  // namespace

BrickInspector::BrickInspector(std::shared_ptr<const SharedElementIndex> index, std::span<const int> fields,
                               const RefineOptions& options, int watched, const Execution& execution)
    : index_(std::move(index)),
      mesh_(index_->mesh(), fields, execution),
      watched_(watched),
      nearest_(index_->mesh(), execution.threads) {
    const std::vector<FieldBound> bounds = errorBounds(index_->mesh(), fields, mesh_, options);
    for (std::size_t f = 0; f < fields.size(); ++f) {
        const auto bound =
            std::find_if(bounds.begin(), bounds.end(), [&](const FieldBound& b) { return b.field == f; });
        boundOfField_.push_back(bound == bounds.end() ? kNone : bound->bound);
        for (int c = 0; c < mesh_.fields()[f].field->components; ++c) channelOf_.emplace_back(int(f), c);
    }
    TESSERA_CHECK(watched >= 0 && std::size_t(watched) < channelOf_.size(), "no such channel");
    const auto [field, component] = channelOf_[std::size_t(watched)];
    range_ = finiteFloatRange(*mesh_.fields()[std::size_t(field)].field, component);
    const double width = range_.width() > 0 ? range_.width() : 1;
    watchedBoundBins_ = watchedBound() / width * kValueBins;
}

ValueMask BrickInspector::binsOf(std::span<const std::int32_t> elements) const {
    const auto [f, component] = channelOf_[std::size_t(watched_)];
    const Field& field = *mesh_.fields()[std::size_t(f)].field;
    ValueMask mask;
    for (const std::int32_t e : elements) {
        int least = kValueBins, most = -1;
        const auto include = [&](double value) {
            if (!std::isfinite(float(value))) return;
            const int bin = binOf(range_, value);
            least = std::min(least, bin);
            most = std::max(most, bin);
        };
        if (field.location == FieldLocation::cell)
            include(field.at(e, component));
        else
            for (const std::int32_t node : mesh_.mesh().tets[std::size_t(e)])
                include(field.at(node, component));
        for (int b = least; b <= most; ++b) mask.set(std::size_t(b));
    }
    return mask;
}

/// The samples of one brick, the nearest mesh values beside them, and others' on its border.
class BrickInspector::Corners {
  public:
    Corners(const BrickInspector& inspector, const Block& samples, const BorderValues& border)
        : inspector_(inspector), samples_(samples), border_(border), last_(samples.box.size() - 1) {}

    double value(int channel, const Vec3i& local) {
        const Vec3i p = samples_.box.min + local;
        const std::size_t offset = samples_.offset(p);
        const bool isGiven = border_ && isOnBorder(local);
        if (!isGiven && samples_.coverage[offset])
            return double(samples_.values[std::size_t(channel) * samples_.count() + offset]);
        if (others_.empty()) {
            slotOf_.assign(samples_.count(), -1);
            others_.reserve(64 * inspector_.channelOf_.size());
        }
        if (slotOf_[offset] < 0) {
            slotOf_[offset] = int(others_.size());
            others_.resize(others_.size() + inspector_.channelOf_.size());
            const std::span<double> values = std::span(others_).last(inspector_.channelOf_.size());
            if (isGiven)
                border_(p, values);
            else
                findNearest(p, values);
        }
        return others_[std::size_t(slotOf_[offset] + channel)];
    }

  private:
    bool isOnBorder(const Vec3i& local) const {
        return local.x == 0 || local.y == 0 || local.z == 0 || local.x == last_.x || local.y == last_.y ||
               local.z == last_.z;
    }

    void findNearest(const Vec3i& p, std::span<double> values) {
        const Vec3d place = samples_.lattice.worldFromIndex(Vec3d(p));
        const NearestPointIndex& nearest = inspector_.nearest_.get();
        NearestPoint found = nearest.find(place, 4 * samples_.lattice.uWorld.x);
        if (found.element < 0) found = nearest.find(place, std::numeric_limits<double>::infinity());
        for (std::size_t c = 0; c < values.size(); ++c) {
            const auto [field, component] = inspector_.channelOf_[c];
            values[c] = found.element < 0
                            ? kNotFinite
                            : found.value(*inspector_.mesh_.fields()[std::size_t(field)].field, component);
            if (!std::isfinite(float(values[c]))) values[c] = kNotFinite;  // as samples are
        }
    }

    const BrickInspector& inspector_;
    const Block& samples_;
    const BorderValues& border_;
    Vec3i last_;
    std::vector<int> slotOf_;
    std::vector<double> others_;
};

BrickFindings BrickInspector::inspect(const DepthKey& key, const Block& samples, const PlanFrame& frame,
                                      const BorderValues& border) const {
    BrickFindings findings;
    const int cells = frame.brickCells;
    const double spacing = frame.spacingWorld(key.depth);
    std::array<float, kValueBins> share{}, error{};
    const std::span<const float> watched = samples.channel(watched_);
    const double width = range_.width() > 0 ? range_.width() : 1;
    std::size_t covered = 0;
    for (std::size_t i = 0; i < samples.count(); ++i)
        if (samples.coverage[i] && std::isfinite(watched[i])) {
            ++share[std::size_t(binOf(range_, double(watched[i])))];
            ++covered;
        }

    const Vec3d first = Vec3d(key.index) * double(cells);
    const Vec3d low = frame.originWorld + first * spacing;
    std::vector<std::int32_t> elements, nodes;
    index_->get().query({low, low + spacing * cells}, elements);
    // As in ErrorSamples: flat elements have no sample, and neither have nodes that only those use.
    std::erase_if(elements, [&](std::int32_t e) { return isFlat(mesh_.mesh(), e); });
    for (const std::int32_t e : elements)
        for (const std::int32_t node : mesh_.mesh().tets[std::size_t(e)]) nodes.push_back(node);
    sortEachOnce(nodes);

    Corners corners(*this, samples, border);
    std::optional<Box3d> within;  // from the origin
    if (frame.boundsWorld)
        within =
            Box3d{frame.boundsWorld->min - frame.originWorld, frame.boundsWorld->max - frame.originWorld};
    const auto note = [&](double exact, double value) {
        for (const double at : {exact, value}) {
            float& most = error[std::size_t(binOf(range_, at))];
            most = std::max(most, float(std::abs(value - exact) / width * kValueBins));
        }
    };
    const auto check = [&](std::size_t sample) {
        const Vec3d placeWorld = mesh_.placeWorld(sample, frame.originWorld);
        const Vec3d local = placeWorld / spacing - first;
        if (!(local.x >= 0 && local.y >= 0 && local.z >= 0 && local.x < cells && local.y < cells &&
              local.z < cells))
            return;
        if (within && !contains(*within, placeWorld)) return;
        const CellPlace place = locateInBrick(local, cells);
        for (std::size_t f = 0; f < boundOfField_.size(); ++f) {
            const SampledField& field = mesh_.fields()[f];
            const int ofField = watched_ - field.firstChannel;  // the watched component, if it is one
            const bool isWatched = ofField >= 0 && ofField < field.field->components;
            if ((field.isCell() && sample < mesh_.nodeCount()) || (!isWatched && boundOfField_[f] == kNone))
                continue;
            double squares = 0;
            for (int k = 0; k < field.field->components; ++k) {
                const double exact = mesh_.exactValue(sample, *field.field, k);
                double value = 0;
                for (int corner = 0; corner < 8; ++corner) {
                    const double weight = cornerWeight(place.fraction, corner);
                    if (weight > 0)
                        value +=
                            weight * corners.value(field.firstChannel + k, place.cell + cornerOffset(corner));
                }
                const double difference = value - exact;
                squares += difference * difference;
                if (k == ofField && std::isfinite(float(exact)) && std::isfinite(difference))
                    note(exact, value);
            }
            // Values that aren't finite as floats have no samples.
            const double ratio = std::sqrt(squares) / boundOfField_[f];
            if (std::isfinite(ratio)) findings.worst = std::max(findings.worst, float(ratio));
        }
    };
    for (const std::int32_t node : nodes) check(std::size_t(node));
    for (const std::int32_t e : elements) check(mesh_.nodeCount() + std::size_t(e));

    for (std::size_t b = 0; b < kValueBins; ++b)
        if (share[b] > 0 || error[b] > 0)
            findings.bins.push_back(
                {std::uint8_t(b), share[b] / float(std::max<std::size_t>(covered, 1)), error[b]});
    return findings;
}

}  // namespace tessera
