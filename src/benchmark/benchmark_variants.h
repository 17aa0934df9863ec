#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "benchmark/benchmark_request.h"
#include "gl/gl_thread.h"
#include "job/run_report.h"
#include "tessera/resampler.h"

namespace tessera {

/// What a variant is in the report.
enum class VariantRole {
    main,       ///< an algorithm as a user gets it
    again,      ///< the first one a second time: what differs is noise
    variation,  ///< other threads, targets, formats, or who makes primitives
    published,  ///< as the paper had it: shows what accuracy costs
    peer        ///< a program of others
};
std::string_view nameOf(VariantRole role);

/// An algorithm with what it runs with.
struct BenchmarkVariant {
    std::string name;  ///< for people, different for each
    VariantRole role = VariantRole::main;
    const Resampler* resampler = nullptr;
    BindOptions bind;
    int threads = 1;

    /// With its own threads, and no progress.
    Execution executionFrom(const Execution& given) const {
        Execution own = given.withoutProgress();
        own.threads = threads;
        return own;
    }
};

struct VariantList {
    std::vector<BenchmarkVariant> variants;
    std::vector<std::unique_ptr<const Resampler>> peers;  ///< what peers' variants point to
    std::vector<std::string> absent;                      ///< a sentence for each that can't run
};

/// The main ones first, then the rest in the order of VariantRole. Where algorithms are named there are these
/// and the peers only, the first of them twice. Throws InputError for a name there isn't.
/// @param execution its threads, and what may end the wait for a peer.
VariantList listVariants(const BenchmarkRequest& request, const Execution& execution);

Json variantJson(const BenchmarkVariant& variant);

/// The device that options name, or the first one. Throws InputError and GlError.
GlThread& deviceOf(const BindOptions& bind);

}  // namespace tessera
