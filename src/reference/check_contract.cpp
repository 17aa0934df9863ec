#include "reference/check_contract.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <limits>
#include <optional>
#include <vector>

#include "base/check.h"
#include "mesh/field_range.h"
#include "reference/format_allowance.h"
#include "reference/random.h"

namespace tessera {

namespace {

std::string format(const char* pattern, ...) {
    char text[512];
    va_list arguments;
    va_start(arguments, pattern);
    std::vsnprintf(text, sizeof text, pattern, arguments);
    va_end(arguments);
    return text;
}

struct Channel {
    const Field* field;
    int component;
    FormatAllowance allowance;
    /// By element, per voxel; negative: not computed yet. Rational arithmetic takes long, and an element may
    /// own many points.
    std::vector<double> gradients;
};

/// Barycentric coordinates of a point in an element, each within 2^-32, when double is enough for that.
std::optional<std::array<double, 4>> quickBarycentrics(const Oracle& oracle, std::int64_t element,
                                                       const Vec3i& p) {
    const auto& tet = oracle.mesh().tets[std::size_t(element)];
    std::array<Vec3d, 4> at;
    Box3d box;
    double farthest = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        const Vec3d& node = oracle.frame().indexNode(tet[i]);
        for (int a = 0; a < 3; ++a) farthest = std::max(farthest, std::abs(node[a]));
        at[i] = node - Vec3d(p);
        box.include(at[i]);
    }
    const Vec3d extent = box.size();
    const double length = std::max({extent.x, extent.y, extent.z});
    // As for the planes in reference_block.cpp: differences of places err by under `slip`, determinants by
    // under 64 length^2 slip.
    const double slip = std::ldexp(farthest, -49) + std::ldexp(length, -52);
    const double volume = dot(cross(at[1] - at[0], at[2] - at[0]), at[3] - at[0]);
    if (!(128 * length * length * slip < 0x1p-33 * std::abs(volume))) return std::nullopt;
    std::array<double, 4> weights{0, dot(cross(at[2], at[0]), at[3]) / volume,
                                  dot(cross(at[0], at[1]), at[3]) / volume,
                                  dot(cross(at[1], at[0]), at[2]) / volume};
    weights[0] = 1 - weights[1] - weights[2] - weights[3];
    return weights;
}

enum class Fault { none, overshoot, inaccurate, wrongCellValue, wrongValidity };

/// How one value fits one element.
struct Fit {
    Fault fault = Fault::none;
    double ratio = 0;  ///< difference over what clause 4 allows
    bool passes() const { return fault == Fault::none; }
};

/// One element as the owner of one lattice point. Weights are found once and serve all channels.
class Owner {
  public:
    Owner(const Oracle& oracle, const Candidate& candidate, const Vec3i& p, const ContractBounds& bounds)
        : oracle_(&oracle), candidate_(candidate), p_(p), bounds_(&bounds) {}

    const Candidate& candidate() const { return candidate_; }

    /// @param uninteresting a ratio at or below this need not be exact, only not too small.
    Fit fit(Channel& channel, float value, double uninteresting) {
        if (channel.field->location == FieldLocation::cell) return fitCell(channel, value);
        const std::array<double, 4> nodes = nodeValues(channel);
        if (!std::all_of(nodes.begin(), nodes.end(), [](double f) { return std::isfinite(float(f)); }))
            return {std::isnan(value) ? Fault::none : Fault::wrongValidity, 0};
        if (!std::isfinite(value)) return {Fault::wrongValidity, 0};
        if (!channel.allowance.isInRange(value, nodes)) return {Fault::overshoot, 0};

        const double error = channel.allowance.error(nodes);
        double ratio = std::abs(double(value) - interpolate(nodes)) / error;
        if (ratio <= uninteresting) return {Fault::none, ratio};
        const double allowed = error + gradient(channel) * bounds_->placeVoxels;
        ratio *= error / allowed;
        if (ratio > 0.99)
            ratio = std::abs(mpq_class(exact(channel) - mpq_class(double(value))).get_d()) / allowed;
        return {ratio <= 1 ? Fault::none : Fault::inaccurate, ratio};
    }

    std::string describe(Channel& channel) {
        const auto& tet = oracle_->mesh().tets[std::size_t(candidate_.element)];
        std::string text =
            format("    element %d: depth %.6g, distance %.6g voxel%s;", candidate_.element,
                   candidate_.depthVoxels, candidate_.distanceVoxels, candidate_.contains ? " (in)" : "");
        if (channel.field->location == FieldLocation::cell)
            return text +
                   format(" cell value %.9g", channel.field->at(candidate_.element, channel.component));
        const std::array<double, 4> nodes = nodeValues(channel);
        if (std::all_of(nodes.begin(), nodes.end(), [](double f) { return std::isfinite(f); }))
            text += format(" exact value %.17g, gradient %.6g per voxel;", exact(channel).get_d(),
                           gradient(channel));
        for (std::size_t i = 0; i < 4; ++i) {
            const Vec3d& at = oracle_->mesh().points[std::size_t(tet[i])];
            text += format(" [%.17g %.17g %.17g: %.17g]", at.x, at.y, at.z, nodes[i]);
        }
        return text;
    }

  private:
    Fit fitCell(const Channel& channel, float value) const {
        const double own = channel.field->at(candidate_.element, channel.component);
        const bool isFinite = std::isfinite(float(own));
        if (isFinite != std::isfinite(value)) return {Fault::wrongValidity, 0};
        if (!isFinite) return {};
        if (!channel.allowance.isOwn(value, own)) return {Fault::wrongCellValue, 0};
        return {Fault::none, channel.allowance.isStepped()
                                 ? std::abs(double(value) - own) / channel.allowance.error(std::span(&own, 1))
                                 : 0};
    }

    std::array<double, 4> nodeValues(const Channel& channel) const {
        std::array<double, 4> values;
        const auto& tet = oracle_->mesh().tets[std::size_t(candidate_.element)];
        for (std::size_t i = 0; i < 4; ++i) values[i] = channel.field->at(tet[i], channel.component);
        return values;
    }

    /// At the element's nearest point, within 2^-29 of the largest node value: far below what float allows.
    double interpolate(const std::array<double, 4>& nodes) {
        if (!weights_) {
            weights_.emplace();
            if (const auto quick = candidate_.contains ? quickBarycentrics(*oracle_, candidate_.element, p_)
                                                       : std::nullopt) {
                *weights_ = *quick;
            } else if (candidate_.contains) {
                *weights_ = oracle_->approximateBarycentrics(candidate_.element, p_);
            } else {
                const ExactWeights exactWeights = oracle_->nearest(candidate_.element, p_).weights;
                for (std::size_t i = 0; i < 4; ++i) (*weights_)[i] = exactWeights[i].get_d();
            }
        }
        double sum = 0;
        for (std::size_t i = 0; i < 4; ++i) sum += (*weights_)[i] * nodes[i];
        return sum;
    }

    mpq_class exact(const Channel& channel) const {
        const ExactWeights weights = oracle_->nearest(candidate_.element, p_).weights;
        return oracle_->interpolate(*channel.field, channel.component, candidate_.element, weights);
    }

    double gradient(Channel& channel) const {
        if (channel.gradients.empty()) channel.gradients.assign(oracle_->mesh().tets.size(), -1);
        double& gradient = channel.gradients[std::size_t(candidate_.element)];
        if (gradient < 0) {
            const mpq_class square =
                oracle_->squaredGradient(*channel.field, channel.component, candidate_.element);
            gradient = std::sqrt(approximateRatio(square.get_num(), square.get_den()));
        }
        return gradient;
    }

    const Oracle* oracle_;
    Candidate candidate_;
    Vec3i p_;
    const ContractBounds* bounds_;
    std::optional<std::array<double, 4>> weights_;
};

/// Goes over a block point by point and fills the report.
class Checker {
  public:
    Checker(const Block& block, const ReferenceBlock& reference, const Oracle& oracle,
            std::span<const int> fields, const ContractBounds& bounds, const CheckOptions& options)
        : block_(block), reference_(reference), oracle_(oracle), bounds_(bounds), options_(options) {
        for (const int f : fields) {
            const Field& field = oracle.mesh().fields[std::size_t(f)];
            for (int c = 0; c < field.components; ++c)
                channels_.push_back(
                    {&field, c, FormatAllowance(bounds.format, finiteFloatRange(field, c)), {}});
        }
        TESSERA_CHECK(block.box == reference.box, "block and reference are of different boxes");
        TESSERA_CHECK(block.channels == int(channels_.size()), "a block has a channel for every component");
        TESSERA_CHECK(
            block.coverage.size() == block.count() && block.values.size() == block.count() * channels_.size(),
            "a block's arrays fit its box");
        TESSERA_CHECK(reference.toleranceVoxels == bounds.spillVoxels, "the reference has another tolerance");
    }

    ContractReport run() {
        Vec3i p;
        const IndexBox& box = block_.box;
        for (p.z = box.min.z; p.z < box.max.z; ++p.z)
            for (p.y = box.min.y; p.y < box.max.y; ++p.y)
                for (p.x = box.min.x; p.x < box.max.x; ++p.x) checkPoint(p);
        return report_;
    }

  private:
    void checkPoint(const Vec3i& p) {
        const std::size_t offset = block_.offset(p);
        const bool isCovered = block_.coverage[offset] != 0;
        ++report_.points;
        report_.inMesh += reference_.mustCover[offset];
        report_.covered += isCovered;
        if (reference_.mustCover[offset] && !isCovered) {
            ++report_.holes;
            offend("hole", p, -1);
        }
        if (!isCovered) return;
        if (!reference_.mayCover(offset)) {
            ++report_.spill;
            offend("spill", p, -1);
            return;
        }
        if (!isChosen(p)) return;
        ++report_.valued;
        checkValues(p, rightOwners(p));
    }

    /// About one point in options.valuesEvery, the same whatever the box.
    bool isChosen(const Vec3i& p) const {
        if (options_.valuesEvery <= 1) return true;
        Random mix(std::uint64_t(std::uint32_t(p.x)) << 32 ^ std::uint64_t(std::uint32_t(p.y)) << 16 ^
                   std::uint64_t(std::uint32_t(p.z)));
        return mix.next() % std::uint64_t(options_.valuesEvery) == 0;
    }

    /// Candidates about as deep as the deepest; those that contain the point come first.
    std::vector<Owner> rightOwners(const Vec3i& p) const {
        // Depths are known within 1e-8 voxel here; a resampler's own rounding is of that order too.
        constexpr double kSlack = 4e-8;
        const auto candidates = reference_.candidatesOf(block_.offset(p));
        double deepest = -std::numeric_limits<double>::infinity();
        for (const Candidate& c : candidates) deepest = std::max(deepest, c.depthVoxels);
        std::vector<Owner> owners;
        for (const Candidate& c : candidates)
            if (c.depthVoxels >= deepest - bounds_.spillVoxels - kSlack)
                owners.emplace_back(oracle_, c, p, bounds_);
        std::stable_partition(owners.begin(), owners.end(),
                              [](const Owner& o) { return o.candidate().contains; });
        return owners;
    }

    float valueAt(std::size_t channel, const Vec3i& p) const {
        return block_.values[channel * block_.count() + block_.offset(p)];
    }

    /// One owner must explain all channels.
    void checkValues(const Vec3i& p, std::vector<Owner> owners) {
        std::vector<std::vector<Fit>> fits;
        double best = std::numeric_limits<double>::infinity();
        std::size_t bestChannel = 0;
        for (Owner& owner : owners) {
            if (best < std::numeric_limits<double>::infinity() && !owner.candidate().contains) break;
            bool passes = true;
            double worst = 0;
            std::size_t worstChannel = 0;
            auto& ofOwner = fits.emplace_back();
            for (std::size_t c = 0; c < channels_.size(); ++c) {
                const Fit& fit =
                    ofOwner.emplace_back(owner.fit(channels_[c], valueAt(c, p), report_.worstRatio));
                passes = passes && fit.passes();
                if (fit.ratio > worst) worst = fit.ratio, worstChannel = c;
            }
            if (passes && worst < best) best = worst, bestChannel = worstChannel;
            if (best <= report_.worstRatio) return;
        }
        if (best < std::numeric_limits<double>::infinity()) {
            report_.worstRatio = best;
            report_.worstRatioPlace = format("(%d %d %d) channel %zu", p.x, p.y, p.z, bestChannel);
            return;
        }
        bool isOfNoChannel = true;
        for (std::size_t c = 0; c < channels_.size(); ++c) {
            const bool passes =
                std::any_of(fits.begin(), fits.end(), [&](const auto& f) { return f[c].passes(); });
            if (passes) continue;
            isOfNoChannel = false;
            classify(p, c, fits);
        }
        if (isOfNoChannel) {
            ++report_.wrongOwner;
            offend("channels of different owners", p, 0);
        }
    }

    /// No right owner explains the value: says which clause it breaks.
    void classify(const Vec3i& p, std::size_t channel, const std::vector<std::vector<Fit>>& fits) {
        const auto all = [&](Fault fault) {
            return std::all_of(fits.begin(), fits.end(),
                               [&](const auto& f) { return f[channel].fault == fault; });
        };
        const Channel& of = channels_[channel];
        const bool isExactCell = of.field->location == FieldLocation::cell && !of.allowance.isStepped();
        const bool isInvalid = all(Fault::wrongValidity);
        if (isOfAnother(p, channel) || (isExactCell && !isInvalid)) {
            ++report_.wrongOwner;
            offend("wrong owner", p, int(channel));
        } else if (isInvalid) {
            ++report_.wrongValidity;
            offend("wrong validity", p, int(channel));
        } else if (all(Fault::overshoot)) {
            ++report_.overshoot;
            offend("overshoot", p, int(channel));
        } else {
            ++report_.inaccurate;
            offend("inaccurate value", p, int(channel));
        }
    }

    /// The value fits an element that covers the point but isn't deep enough to own it.
    bool isOfAnother(const Vec3i& p, std::size_t channel) {
        for (const Candidate& candidate : reference_.candidatesOf(block_.offset(p))) {
            Owner owner(oracle_, candidate, p, bounds_);
            if (owner.fit(channels_[channel], valueAt(channel, p), 0).passes()) return true;
        }
        return false;
    }

    void offend(const char* what, const Vec3i& p, int channel) {
        if (!report_.firstOffence.empty()) return;
        const Vec3d world = block_.lattice.worldFromIndex(Vec3d(p));
        std::string text = format("%s at lattice point (%d %d %d), world (%.17g %.17g %.17g)", what, p.x, p.y,
                                  p.z, world.x, world.y, world.z);
        const auto c = std::size_t(std::max(channel, 0));
        if (channel >= 0) {
            const auto value = double(valueAt(c, p));
            text += format(", channel %d (%s): value %.9g = %a", channel, channels_[c].field->name.c_str(),
                           value, value);
        }
        const auto candidates = reference_.candidatesOf(block_.offset(p));
        for (std::size_t i = 0; i < std::min<std::size_t>(candidates.size(), 8) && !channels_.empty(); ++i)
            text.append("\n").append(Owner(oracle_, candidates[i], p, bounds_).describe(channels_[c]));
        if (candidates.size() > 8) text += format("\n    and %zu more elements", candidates.size() - 8);
        report_.firstOffence = text;
    }

    const Block& block_;
    const ReferenceBlock& reference_;
    const Oracle& oracle_;
    const ContractBounds& bounds_;
    const CheckOptions& options_;
    std::vector<Channel> channels_;
    ContractReport report_;
};

}  // namespace

ContractReport& ContractReport::operator+=(const ContractReport& other) {
    points += other.points, inMesh += other.inMesh, covered += other.covered, valued += other.valued;
    holes += other.holes, spill += other.spill, overshoot += other.overshoot;
    inaccurate += other.inaccurate, wrongOwner += other.wrongOwner, wrongValidity += other.wrongValidity;
    if (other.worstRatio > worstRatio) worstRatio = other.worstRatio, worstRatioPlace = other.worstRatioPlace;
    if (firstOffence.empty()) firstOffence = other.firstOffence;
    return *this;
}

std::string ContractReport::summary() const {
    std::string text = format(
        "points %lld, in mesh %lld, covered %lld, values checked at %lld; holes %lld, spill %lld, overshoot "
        "%lld, inaccurate %lld, wrong owner %lld, wrong validity %lld; worst accuracy ratio %.4f",
        (long long)points, (long long)inMesh, (long long)covered, (long long)valued, (long long)holes,
        (long long)spill, (long long)overshoot, (long long)inaccurate, (long long)wrongOwner,
        (long long)wrongValidity, worstRatio);
    if (!worstRatioPlace.empty()) text += " at " + worstRatioPlace;
    if (!firstOffence.empty()) text += "\n  first: " + firstOffence;
    return text;
}

ContractReport checkContract(const Block& block, const ReferenceBlock& reference, const Oracle& oracle,
                             std::span<const int> fields, const ContractBounds& bounds,
                             const CheckOptions& options) {
    return Checker(block, reference, oracle, fields, bounds, options).run();
}

}  // namespace tessera
