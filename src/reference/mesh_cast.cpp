#include "reference/mesh_cast.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "base/parallel.h"
#include "reference/ray_elements.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Less light than this share can't be seen in a float.
constexpr double kNoLight = 1e-8;

using Colour = std::array<double, 3>;

/// The transfer function between two neighbouring stops, or beyond them: linear.
struct Piece {
    double low = 0, high = 0;  ///< values
    Colour colourLow{}, colourHigh{};
    double clearLow = 1, clearHigh = 1;  ///< 1 - opacity

    double shareAt(double value) const {
        return std::isfinite(low) && std::isfinite(high) ? (value - low) / (high - low) : 0;
    }
    double clearAt(double share) const { return clearLow + share * (clearHigh - clearLow); }
    Colour colourAt(double share) const {
        Colour colour;
        for (std::size_t c = 0; c < 3; ++c) colour[c] = colourLow[c] + share * (colourHigh[c] - colourLow[c]);
        return colour;
    }
};

/// All of them, ascending; steps have none.
std::vector<Piece> piecesOf(const TransferFunction& function) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    std::vector<Piece> pieces;
    const auto add = [&](double low, double high, const TransferFunction::Stop& a,
                         const TransferFunction::Stop& b) {
        if (low < high) pieces.push_back({low, high, a.color, b.color, 1 - a.opacity, 1 - b.opacity});
    };
    const auto& stops = function.stops;
    add(-kInfinity, stops.front().value, stops.front(), stops.front());
    for (std::size_t i = 1; i < stops.size(); ++i)
        add(stops[i - 1].value, stops[i].value, stops[i - 1], stops[i]);
    add(stops.back().value, kInfinity, stops.back(), stops.back());
    return pieces;
}

/// The absorption of a part of a ray along which 1 - opacity runs linearly from `from` to `to`; u is the
/// share of the part.
class Absorption {
  public:
    /// @param layers that the part is long.
    Absorption(double from, double to, double layers) : from_(from), to_(to), layers_(layers) {}

    double clearAt(double u) const { return from_ + u * (to_ - from_); }
    /// The optical depth up to u: the integral of -ln(clear).
    double depthAt(double u) const {
        const double clear = clearAt(u), change = clear - from_;
        // The difference below would lose its digits.
        if (std::abs(change) <= 1e-4 * from_) return -std::log(from_ + change / 2) * u * layers_;
        return (integral(clear) - integral(from_)) / change * u * layers_;
    }
    /// The integral of the light that is left, between places where the depth is `depth0` and `depth1`.
    double lightBetween(double u0, double u1, double depth0, double depth1) const {
        const double length = u1 - u0;
        if (depth0 > 20) return 0;
        const double clear0 = clearAt(u0), clear1 = clearAt(u1);
        const bool isSmooth =
            depth1 - depth0 <= 0.25 && std::max(clear0, clear1) <= 4 * std::min(clear0, clear1);
        if (isSmooth || depth1 - depth0 <= 1e-7 || length < 1e-6) {  // Gauss, three points
            const double middle = 0.5 * (u0 + u1), besides = length / 2 * std::sqrt(0.6);
            return length / 18 *
                   (8 * std::exp(-depthAt(middle)) + 5 * std::exp(-depthAt(middle - besides)) +
                    5 * std::exp(-depthAt(middle + besides)));
        }
        const double middle = 0.5 * (u0 + u1), depth = depthAt(middle);
        return lightBetween(u0, middle, depth0, depth) + lightBetween(middle, u1, depth, depth1);
    }

  private:
    /// Of -ln(b) over b.
    static double integral(double b) { return b > 0 ? b - b * std::log(b) : 0; }

    double from_, to_, layers_;
};

/// Light on its way to the eye.
class Light {
  public:
    Light(std::span<const Piece> pieces, double layerWorld) : pieces_(pieces), layerWorld_(layerWorld) {}

    bool isDark() const { return light_ <= kNoLight; }
    Rgba colour() const { return {float(sum_[0]), float(sum_[1]), float(sum_[2]), float(1 - light_)}; }

    /// Along a part of the ray the value runs linearly from one to the other.
    void pass(double from, double to, double lengthWorld) {
        if (from == to) return passPiece(pieceAbove(from), from, to, lengthWorld);
        const double change = to - from;
        const bool isRising = change > 0;
        std::size_t i = isRising ? pieceAbove(from) : pieceBelow(from);
        while (!isDark()) {
            const Piece& piece = pieces_[i];
            const double next = isRising ? std::min(piece.high, to) : std::max(piece.low, to);
            passPiece(i, from, next, (next - from) / change * lengthWorld);
            if (next == to) return;
            from = next;
            i = isRising ? i + 1 : i - 1;
        }
    }

  private:
    /// What a value has that is on a step is what stands above it.
    std::size_t pieceAbove(double value) const {
        return std::size_t(std::upper_bound(pieces_.begin(), pieces_.end(), value,
                                            [](double v, const Piece& piece) { return v < piece.high; }) -
                           pieces_.begin());
    }
    std::size_t pieceBelow(double value) const {
        return std::size_t(std::lower_bound(pieces_.begin(), pieces_.end(), value,
                                            [](const Piece& piece, double v) { return piece.high < v; }) -
                           pieces_.begin());
    }

    void passPiece(std::size_t number, double from, double to, double lengthWorld) {
        const Piece& piece = pieces_[number];
        const double shareFrom = piece.shareAt(from), shareTo = piece.shareAt(to);
        const double clearFrom = piece.clearAt(shareFrom), clearTo = piece.clearAt(shareTo);
        if (!(lengthWorld > 0) || (clearFrom == 1 && clearTo == 1)) return;
        const Colour colour = piece.colourAt(shareFrom), colourTo = piece.colourAt(shareTo);
        if (clearFrom == 0 && clearTo == 0) {
            for (std::size_t c = 0; c < 3; ++c) sum_[c] += light_ * colour[c];
            light_ = 0;
            return;
        }
        const Absorption absorption(clearFrom, clearTo, lengthWorld / layerWorld_);
        const double depth = absorption.depthAt(1), left = std::exp(-depth);
        // By parts: the colour at the near end times what is absorbed, and its change times what is later on.
        const double mean = colour == colourTo ? left : absorption.lightBetween(0, 1, 0, depth);
        for (std::size_t c = 0; c < 3; ++c)
            sum_[c] += light_ * (-std::expm1(-depth) * colour[c] + (mean - left) * (colourTo[c] - colour[c]));
        light_ *= left;
    }

    std::span<const Piece> pieces_;
    double layerWorld_;
    Colour sum_{};
    double light_ = 1;
};

/// An element on a ray: along it distances to the planes are linear.
class CutElement {
  public:
    CutElement(const TetMesh& mesh, const MeshCastOptions& options, std::int64_t number,
               const Vec3d& eyeWorld, const ViewRay& ray)
        : element(number) {
        const ElementPlanes planes = *elementPlanes(mesh, std::size_t(element), eyeWorld);
        const Field& field = mesh.fields[std::size_t(options.field)];
        for (std::size_t f = 0; f < 4; ++f) {
            const std::int64_t item =
                field.location == FieldLocation::cell ? element : mesh.tets[std::size_t(element)][f];
            values_[f] = field.at(item, options.component);
            const double start = glm::dot(planes.normals[f], ray.originWorld - eyeWorld) - planes.offsets[f];
            const double rise = glm::dot(planes.normals[f], ray.direction);
            weights_[f] = {start / planes.atNodes[f], rise / planes.atNodes[f]};
            const double length = glm::length(planes.normals[f]);
            distances_[f] = {start / length, rise / length};
        }
        isCell_ = field.location == FieldLocation::cell;
    }

    bool isFinite() const {
        return std::all_of(values_.begin(), values_.end(), [](double v) { return std::isfinite(float(v)); });
    }
    /// Within the values of the nodes.
    double valueAt(double at) const {
        if (isCell_) return values_[0];
        double sum = 0, weight = 0;
        for (std::size_t f = 0; f < 4; ++f) {
            const double w = std::max(weights_[f].at(at), 0.0);
            sum += w * values_[f];
            weight += w;
        }
        const auto [low, high] = std::minmax_element(values_.begin(), values_.end());
        return std::clamp(sum / weight, *low, *high);
    }
    double depthAt(double at) const {
        double depth = std::numeric_limits<double>::infinity();
        for (const Linear& distance : distances_) depth = std::min(depth, distance.at(at));
        return depth;
    }
    /// Appends where a plane of this one is as far away as one of another, between two places.
    void appendCrossings(const CutElement& other, const RaySpan& within, std::vector<double>& places) const {
        for (const Linear& a : distances_)
            for (const Linear& b : other.distances_) {
                const double at = (b.start - a.start) / (a.rise - b.rise);
                if (at > within.begin && at < within.end) places.push_back(at);
            }
    }

    std::int64_t element;

  private:
    /// Along the ray.
    struct Linear {
        double start = 0, rise = 0;
        double at(double place) const { return start + place * rise; }
    };
    std::array<double, 4> values_{};
    std::array<Linear, 4> weights_, distances_;
    bool isCell_ = false;
};

/// One ray through elements.
class MeshRay {
  public:
    MeshRay(const TetMesh& mesh, const Camera& camera, const MeshCastOptions& options, const ViewRay& ray,
            Light& light)
        : mesh_(mesh), camera_(camera), options_(options), ray_(ray), light_(light) {}

    void follow(std::vector<ElementSpan> spans) {
        std::sort(spans.begin(), spans.end(), [](const ElementSpan& a, const ElementSpan& b) {
            return a.span.begin != b.span.begin ? a.span.begin < b.span.begin : a.element < b.element;
        });
        std::vector<double> borders;
        for (const ElementSpan& span : spans) borders.insert(borders.end(), {span.span.begin, span.span.end});
        std::sort(borders.begin(), borders.end());
        std::vector<ElementSpan> open;
        std::size_t next = 0;
        for (std::size_t i = 1; i < borders.size() && !light_.isDark(); ++i) {
            const RaySpan part{borders[i - 1], borders[i]};
            std::erase_if(open, [&](const ElementSpan& span) { return span.span.end <= part.begin; });
            for (; next < spans.size() && spans[next].span.begin <= part.begin; ++next)
                open.push_back(spans[next]);
            if (part.end - part.begin > kTouching * part.end && !open.empty()) pass(open, part);
        }
    }

  private:
    void pass(std::span<const ElementSpan> open, const RaySpan& part) {
        std::vector<CutElement> elements;
        for (const ElementSpan& span : open)
            elements.emplace_back(mesh_, options_, span.element, camera_.eyeWorld, ray_);
        std::vector<double> places{part.begin, part.end};
        for (std::size_t i = 0; i < elements.size(); ++i)
            for (std::size_t j = 0; j < i; ++j) elements[i].appendCrossings(elements[j], part, places);
        std::sort(places.begin(), places.end());
        for (std::size_t i = 1; i < places.size() && !light_.isDark(); ++i) {
            const double middle = 0.5 * (places[i - 1] + places[i]);
            const CutElement& owner = *std::min_element(
                elements.begin(), elements.end(), [&](const CutElement& a, const CutElement& b) {
                    const double depthA = a.depthAt(middle), depthB = b.depthAt(middle);
                    return depthA != depthB ? depthA > depthB : a.element < b.element;
                });
            if (owner.isFinite())
                light_.pass(owner.valueAt(places[i - 1]), owner.valueAt(places[i]),
                            places[i] - places[i - 1]);
        }
    }

    const TetMesh& mesh_;
    const Camera& camera_;
    const MeshCastOptions& options_;
    const ViewRay& ray_;
    Light& light_;
};

}  // namespace

RgbaImage castMesh(const TetMesh& mesh, const Camera& camera, const MeshCastOptions& options,
                   const Execution& execution) {
    checkTransferFunction(options.function);
    if (!(options.layerWorld > 0)) throw InputError("rays need a layer of a length above 0");
    if (options.field < 0 || std::size_t(options.field) >= mesh.fields.size() || options.component < 0 ||
        options.component >= mesh.fields[std::size_t(options.field)].components)
        throw InputError("the mesh has no such field and component to draw");
    const std::vector<Piece> pieces = piecesOf(options.function);
    const RayElements elements(mesh, camera, execution);
    RgbaImage image{camera.widthPixels, camera.heightPixels, {}};
    image.pixels.resize(std::size_t(image.width) * std::size_t(image.height));
    parallelFor(execution, image.height, [&](std::int64_t y) {
        std::vector<std::vector<ElementSpan>> row = elements.ofRow(int(y));
        for (int x = 0; x < image.width; ++x) {
            const ViewRay ray = elements.view().rayOf(camera, x, int(y));
            Light light(pieces, options.layerWorld);
            MeshRay(mesh, camera, options, ray, light).follow(std::move(row[std::size_t(x)]));
            image.at(x, int(y)) = light.colour();
        }
    });
    return image;
}

}  // namespace tessera
