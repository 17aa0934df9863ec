#pragma once

#include <optional>
#include <string>
#include <vector>

#include "benchmark/page_json.h"
#include "benchmark/plot_parts.h"

namespace tessera {

/// What is compared: an algorithm with its settings, or another program.
struct PageVariant {
    std::string name, algorithm, role, note;
    PlotStyle style;

    bool isPeer() const { return role == "peer"; }
    bool isAgain() const { return role == "again"; }
    bool isVariation() const { return role == "variation"; }
};

struct PageRun {
    std::size_t index = 0;  ///< in the document's list
    const PageVariant* variant = nullptr;
    std::string criterion, asked;
    std::optional<double> resolution, voxels, pictureRms;
    std::optional<PageTime> time;
    const Json* json = nullptr;

    bool isUniform() const { return criterion == "uniform"; }
    /// @param measure "max", "p999" or "rms".
    std::optional<double> error(std::string_view measure) const;
};

/// A benchmark's document as the sections of the page read it. Refers to the document.
class PageSource {
  public:
    explicit PageSource(const Json& document);
    PageSource(const PageSource&) = delete;
    PageSource& operator=(const PageSource&) = delete;

    const Json& json() const { return document_; }
    /// In the order of the page: main, published, peers, variations, again.
    const std::vector<PageVariant>& variants() const { return variants_; }
    const PageVariant& variant(const Json& entry) const;
    const std::vector<PageRun>& runs() const { return runs_; }
    std::vector<std::string> peers() const;
    /// "Not here: VTK.", for a plot that has values of those variants only; empty if no peer lacks.
    std::string missingPeers(const std::vector<std::string>& present) const;

  private:
    void readVariants();
    void addNamesIn(const Json& json);
    void giveStyles();

    const Json& document_;
    std::vector<PageVariant> variants_;
    std::vector<PageRun> runs_;
};

/// "uniform", "by error", "by element size", "around a focus".
std::string criterionInWords(const std::string& criterion);
/// "largest error", "typical error (RMS)".
std::string measureInWords(const std::string& measure);

}  // namespace tessera
