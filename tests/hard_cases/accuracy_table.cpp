// Runs the gallery of hard cases through every algorithm against the exact oracle and prints what
// docs/accuracy.md shows; --update writes it there. Exit code 1 when a single point breaks the contract.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>

#include "arguments.h"
#include "hard_cases.h"
#include "perturbed_cases.h"
#include "tessera/registry.h"

namespace tessera::hard_cases {
namespace {

using contract::LatticeCase;
using contract::Subject;

constexpr int kThinnest = 8;  // elements of a case through which a lattice of its own goes

struct Arguments {
    std::vector<int> cells{16, 32, 64, 128};
    int formatCells = 16;
    std::vector<std::string> algorithms;
    std::string only;
    std::int64_t perturbedOnProcessor = 2000;
    std::int64_t perturbedOnDevice = 200;
    std::uint64_t seed = 1;
    std::string update;
};

/// What was found for one subject in one row of cases.
struct Tally {
    ContractReport report;
    std::int64_t wrongConstants = 0;
    std::int64_t exceptions() const {
        const ContractReport& r = report;
        return r.holes + r.spill + r.overshoot + r.inaccurate + r.wrongOwner + r.wrongValidity +
               wrongConstants;
    }
};

struct Row {
    std::string name, sentence;
    int cases = 0;
    std::map<std::string, Tally> bySubject;
};

class Table {
  public:
    explicit Table(const Arguments& arguments) : arguments_(arguments) {
        for (const Subject& subject : contract::subjectsOf(resamplers())) {
            const std::string name(subject.resampler->name());
            const auto& wanted = arguments.algorithms;
            if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), name) == wanted.end()) continue;
            if (!subject.isPrimary && subject.format == SampleFormat::r32f) continue;
            if (const std::string reason = subject.unavailableReason(); !reason.empty()) {
                fmt::print(stderr, "{} is left out: {}\n", subject.name, reason);
                continue;
            }
            (subject.isPrimary ? algorithms_ : formats_).push_back(subject);
        }
    }

    /// False when there is no case to run.
    bool run() {
        for (const HardCase& hardCase : hardCases())
            if (hardCase.name.find(arguments_.only) != std::string::npos) runCase(hardCase);
        for (const auto* subjects : {&algorithms_, &formats_})
            for (const Subject& subject : *subjects) {
                const std::int64_t count =
                    subject.isOnDevice() ? arguments_.perturbedOnDevice : arguments_.perturbedOnProcessor;
                if (count <= 0 || (!subject.isPrimary && subject.isOnDevice() && subjects == &formats_))
                    continue;
                perturbed_[subject.name] = checkPerturbed(subject, arguments_.seed, count);
                fmt::print(stderr, "perturbed, {}: {}\n", subject.name,
                           perturbed_[subject.name].total.summary());
            }
        return !rows_.empty();
    }

    bool isClean() const {
        for (const Row& row : rows_)
            for (const auto& [name, tally] : row.bySubject)
                if (tally.exceptions() > 0) return false;
        return std::all_of(perturbed_.begin(), perturbed_.end(),
                           [](const auto& p) { return p.second.unclean == 0; });
    }

    std::string markdown() const { return caseTable() + "\n" + formatTable() + "\n" + perturbedTable(); }

  private:
    void runCase(const HardCase& hardCase) {
        const auto start = std::chrono::steady_clock::now();
        const TetMesh mesh = hardCase.make();
        Row& row = rowOf(hardCase);
        ++row.cases;
        for (const int cells : arguments_.cells)
            for (const LatticeCase& at : latticesOf(mesh, cells))
                runLattice(hardCase, mesh, at, cells <= arguments_.formatCells && !hardCase.isLarge, row);
        if (!hardCase.isLarge)
            for (const LatticeCase& at : latticesThroughThinnest(mesh, kThinnest))
                runLattice(hardCase, mesh, at, true, row);
        const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
        std::int64_t exceptions = 0;
        for (const auto& [name, tally] : row.bySubject) exceptions += tally.exceptions();
        fmt::print(stderr, "{}: {} exceptions in its row so far, {:.1f} s\n", hardCase.name, exceptions,
                   elapsed.count());
    }

    void runLattice(const HardCase& hardCase, const TetMesh& mesh, const LatticeCase& at, bool inAllFormats,
                    Row& row) {
        contract::Measure measure(mesh, at);
        for (const Subject& subject : algorithms_)
            sampleAndMeasure(hardCase, mesh, at, measure, subject, row);
        if (!inAllFormats) return;
        for (const Subject& subject : formats_) sampleAndMeasure(hardCase, mesh, at, measure, subject, row);
    }

    void sampleAndMeasure(const HardCase& hardCase, const TetMesh& mesh, const LatticeCase& at,
                          contract::Measure& measure, const Subject& subject, Row& row) {
        const std::vector<int> fields = everyField(mesh);
        const Block block = std::move(contract::sample(*subject.resampler, mesh, fields, at.lattice,
                                                       std::span(&at.box, 1), {subject.bindOptions(), 2})[0]);
        const ContractReport report = measure(subject, block);
        if (!report.isClean())
            fmt::print(stderr, "{}, {}, lattice {}: {}\n", hardCase.name, subject.name, at.name,
                       report.summary());
        Tally& tally = row.bySubject[subject.name];
        tally.report += report;
        if (hardCase.isConstant) tally.wrongConstants += wrongConstants(mesh, block);
    }

    Row& rowOf(const HardCase& hardCase) {
        for (Row& row : rows_)
            if (row.name == hardCase.row) return row;
        rows_.push_back({hardCase.row, hardCase.sentence, 0, {}});
        return rows_.back();
    }

    static std::string cell(const Tally& tally) {
        const ContractReport& r = tally.report;
        const std::int64_t rest = r.inaccurate + r.wrongOwner + r.wrongValidity + tally.wrongConstants;
        return fmt::format("{} / {} / {} / {} | {:.2f}", r.holes, r.spill, r.overshoot, rest, r.worstRatio);
    }

    /// The same for every algorithm, but that a large case is for some alone.
    static std::int64_t pointsInMesh(const std::map<std::string, Tally>& bySubject) {
        std::int64_t most = 0;
        for (const auto& [name, tally] : bySubject) most = std::max(most, tally.report.inMesh);
        return most;
    }

    std::string caseTable() const {
        std::string text = "| cases | what is hard | points in the mesh |";
        std::string rule = "|---|---|---:|";
        for (const Subject& subject : algorithms_) {
            text += fmt::format(" {} | worst |", subject.resampler->name());
            rule += "---|---:|";
        }
        text += fmt::format("\n{}\n", rule);
        for (const Row& row : rows_) {
            text += fmt::format("| {} ({}) | {} | {} |", row.name, row.cases, row.sentence,
                                pointsInMesh(row.bySubject));
            for (const Subject& subject : algorithms_) {
                const auto found = row.bySubject.find(subject.name);
                text += found == row.bySubject.end() ? std::string(" | |")
                                                     : fmt::format(" {} |", cell(found->second));
            }
            text += "\n";
        }
        std::map<std::string, Tally> all = total();
        text += fmt::format("| **all** | | {} |", pointsInMesh(all));
        for (const Subject& subject : algorithms_) text += fmt::format(" {} |", cell(all[subject.name]));
        text += "\n\nPoints checked:";
        for (const Subject& subject : algorithms_)
            text += fmt::format(" {} {:.1f} million, {:.1f} million of them in the mesh;",
                                subject.resampler->name(), double(all[subject.name].report.points) * 1e-6,
                                double(all[subject.name].report.inMesh) * 1e-6);
        text.back() = '.';
        return text + fmt::format(
                          " Lattices of {} cells along the longest side, and small ones through "
                          "the centroids of each case's {} thinnest elements.\n",
                          fmt::join(arguments_.cells, ", "), kThinnest);
    }

    std::string formatTable() const {
        if (formats_.empty()) return {};
        std::string text = fmt::format(
            "| algorithm | format | holes / spill / overshoot / wrong values | worst "
            "|\n|---|---|---|---:|\n");
        std::map<std::string, Tally> all = total();
        for (const auto* subjects : {&algorithms_, &formats_})
            for (const Subject& subject : *subjects)
                text += fmt::format("| {} | {} | {} |\n", subject.resampler->name(), nameOf(subject.format),
                                    cell(all[subject.name]));
        return text + fmt::format("\nFormats other than r32f on lattices of up to {} cells.\n",
                                  arguments_.formatCells);
    }

    std::string perturbedTable() const {
        if (perturbed_.empty()) return {};
        std::string text =
            "| perturbed cases | seeds | holes / spill / overshoot / wrong values | worst "
            "|\n|---|---|---|---:|\n";
        for (const auto* subjects : {&algorithms_, &formats_})
            for (const Subject& subject : *subjects) {
                const auto found = perturbed_.find(subject.name);
                if (found == perturbed_.end()) continue;
                text += fmt::format("| {}, {} | {} to {} | {} |\n", subject.resampler->name(),
                                    nameOf(subject.format), arguments_.seed,
                                    arguments_.seed + std::uint64_t(found->second.cases) - 1,
                                    cell({found->second.total, 0}));
            }
        return text;
    }

    std::map<std::string, Tally> total() const {
        std::map<std::string, Tally> all;
        for (const Row& row : rows_)
            for (const auto& [name, tally] : row.bySubject) {
                all[name].report += tally.report;
                all[name].wrongConstants += tally.wrongConstants;
            }
        return all;
    }

    Arguments arguments_;
    std::vector<Subject> algorithms_, formats_;
    std::vector<Row> rows_;
    std::map<std::string, PerturbedReport> perturbed_;
};

constexpr std::string_view kBegin = "<!-- tables: begin -->\n", kEnd = "<!-- tables: end -->";

/// Puts the text between the markers of a file.
bool updateFile(const std::string& path, const std::string& text) {
    std::ifstream in(path);
    std::string content{std::istreambuf_iterator<char>(in), {}};
    const std::size_t begin = content.find(kBegin), end = content.find(kEnd);
    if (!in || begin == std::string::npos || end == std::string::npos || end < begin) {
        fmt::print(stderr, "{}: can't be read, or has no markers {}\n", path, kBegin);
        return false;
    }
    content.replace(begin + kBegin.size(), end - begin - kBegin.size(), text);
    std::ofstream out(path);
    out << content;
    return bool(out.flush());
}

}  // namespace
}  // namespace tessera::hard_cases

int main(int argc, char** argv) {
    using namespace tessera::hard_cases;
    Arguments arguments;
    tessera::bench::Arguments words("Measures the gallery of hard cases against exact arithmetic.");
    words.add("--cells", arguments.cells, "lattice spacings along the longest side");
    words.add("--format-cells", arguments.formatCells, "formats other than r32f up to this many");
    words.add("--algorithms", arguments.algorithms, "all without this");
    words.add("--only", arguments.only, "cases with this in their name");
    words.add("--perturbed", arguments.perturbedOnProcessor, "random perturbed cases for software");
    words.add("--perturbed-gl", arguments.perturbedOnDevice, "the same for each OpenGL algorithm");
    words.add("--seed", arguments.seed, "the first perturbed case");
    words.add("--update", arguments.update, "write the tables between the markers of this file");
    return words.run(argc, argv, [&] {
        if (!arguments.update.empty() && (!arguments.only.empty() || !arguments.algorithms.empty())) {
            fmt::print(stderr, "--update takes the whole gallery, without --only and --algorithms\n");
            return 2;
        }
        Table table(arguments);
        if (!table.run()) {
            fmt::print(stderr, "no case has '{}' in its name\n", arguments.only);
            return 2;
        }
        const std::string text = table.markdown();
        std::fputs(text.c_str(), stdout);
        if (!arguments.update.empty() && !updateFile(arguments.update, text)) return 1;
        return table.isClean() ? 0 : 1;
    });
}
