#include "raster/primitive_maker.h"

#include <algorithm>

#include "raster/shaders.h"

namespace tessera {

namespace {

/// What the algorithms' shaders round, in voxels: of a place for each voxel of an element's size.
constexpr float kPlaceRounding = 0x1p-19f;

constexpr GLuint kNoSlot = ~GLuint(0);

std::size_t bytesOf(std::size_t kind) {
    return isLargeKind(kind) ? 4 * sizeof(PolygonVertex) : sizeof(Sprite);
}

}  // namespace

std::vector<PrimitiveMaker::Slab> PrimitiveMaker::slabs(const LayerCounts& layers, std::int64_t most) {
    std::vector<Slab> all;
    std::int64_t bytes = 0;
    for (int layer = 0; layer < int(layers.size()); ++layer) {
        std::int64_t ofLayer = 0;
        for (std::size_t kind = 0; kind < kKinds; ++kind)
            ofLayer += std::int64_t(layers[std::size_t(layer)][kind]) * std::int64_t(bytesOf(kind));
        if (ofLayer == 0) continue;
        if (all.empty() || bytes + ofLayer > most) {
            all.push_back({layer, layer, {}});
            bytes = 0;
        }
        bytes += ofLayer;
        all.back().end = layer + 1;
        for (std::size_t kind = 0; kind < kKinds; ++kind)
            all.back().counts[kind] += layers[std::size_t(layer)][kind];
    }
    return all;
}

const GlProgram& PrimitiveMaker::program(GlContext& context, const ShaderText* algorithm, std::size_t kind,
                                         bool areCounts) {
    // Thin and easy large elements go by their nodes alike, and marks by a uniform.
    kind = !algorithm ? 0 : isLargeKind(kind) ? 1 : kind;
    const Variant variant{algorithm ? algorithm->name : std::string_view(), kind, areCounts};
    const auto found = programs_.find(variant);
    if (found != programs_.end()) return found->second;
    namespace text = shaders::raster;
    std::vector<ShaderDefine> defines = recordDefines();
    for (const ShaderDefine& define :
         {ShaderDefine{"CHANNELS"}, ShaderDefine{"LARGEST_EXTENT", glslOf(float(kLargestPolygon))},
          ShaderDefine{"GROWTH", glslOf(float(kGrowth))},
          ShaderDefine{"PLACE_ROUNDING", glslOf(kPlaceRounding)}})
        defines.push_back(define);
    if (areCounts) defines.push_back({"COUNTS"});
    std::vector<ShaderText> shared{text::kThreads, text::kRanks, text::kScanBoxes, text::kDrawnLayers};
    if (algorithm && isLargeKind(kind)) {
        defines.push_back({"LARGE"});
        shared.insert(shared.end(), {text::kPlacedNodes, text::kElementShape, *algorithm});
    } else if (algorithm) {
        if (isThinKind(kind)) defines.push_back({"THIN"});
        shared.insert(shared.end(), {text::kRecordTypes, text::kRecord, text::kPixelRows, *algorithm});
    }
    GlProgram made = makeComputeProgram(context, algorithm ? text::kSlicePrimitives : text::kDrawnMarks,
                                        std::move(shared), std::move(defines));
    return programs_.emplace(variant, std::move(made)).first->second;
}

PrimitiveMaker::Made PrimitiveMaker::make(GlContext& context, RecordMaker& records, const DeviceMesh& mesh,
                                          const SliceAxes& axes, const ShaderText& algorithm,
                                          const Slab& slab, std::size_t kind) {
    // Each of the elements has a primitive, or may have one.
    const std::size_t listed = records.listedCount_, words = (listed + 31) / 32,
                      most = std::min(listed, std::size_t(slab.counts[kind]));
    const auto use = [&](const ShaderText* text, bool areCounts) {
        ComputeUse used{context, program(context, text, kind, areCounts)};
        used.set("kind", kind);
        used.set("layerBegin", std::size_t(slab.begin));
        used.set("layerEnd", std::size_t(slab.end));
        used.set("axes", Vec3i(axes.s, axes.t, axes.l));
        used.set("listedCount", listed);
        used.set("elementCount", most);
        return used;
    };
    // Threads that run in step wait for what others do: the elements that are drawn are listed first.
    grow(context, marks_, words * sizeof(GLuint));
    const ComputeUse mark = use(nullptr, false);
    mark.bind(0, records.boxes_);
    mark.bind(1, marks_);
    mark.run(words);
    records.addUp(context, marks_, words, true, sums_);
    grow(context, slots_, most * sizeof(GLuint));
    fill(context, slots_, most * sizeof(GLuint), kNoSlot);
    records.list(context, marks_, sums_, words, slots_);
    grow(context, counts_, most * sizeof(GLuint));
    grow(context, primitives_, std::size_t(slab.counts[kind]) * bytesOf(kind));
    std::size_t total = 0;
    for (const bool areCounts : {true, false}) {
        ComputeUse making = use(&algorithm, areCounts);
        if (isLargeKind(kind))
            records.usePlaced(making, mesh);
        else
            making.bind(0, isThinKind(kind) ? records.thinGeometry_ : records.easyGeometry_);
        making.bind(2, records.listed_);
        making.bind(3, records.boxes_);
        making.bind(4, slots_);
        making.bind(5, areCounts ? counts_ : sums_);
        if (!areCounts) making.bind(6, primitives_);
        making.run(most);
        if (areCounts) total = records.addUp(context, counts_, most, false, sums_);
    }
    return {primitives_.id(), readItems<GLuint>(context, sums_, total, 1).front()};
}

}  // namespace tessera
