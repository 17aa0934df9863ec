#include "job/output_paths.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <cctype>
#include <filesystem>
#include <map>

#include "files/atomic_file.h"
#include "mesh_files/mesh_series.h"
#include "tessera/error.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;

/// The same for two paths exactly when they are the same file: device and inode where there is a file, else
/// the name with its links resolved. A series may have thousands of steps, so keys, not pairs, are compared.
std::string fileKey(const std::string& path) {
    struct stat status {};
    if (::stat(path.c_str(), &status) == 0) return fmt::format("{}:{}", status.st_dev, status.st_ino);
    std::error_code failure;
    fs::path name = fs::absolute(path, failure);
    // A link to nothing counts as what it points to.
    for (int links = 0; links < 40 && fs::is_symlink(fs::symlink_status(name, failure)); ++links)
        name = name.parent_path() / fs::read_symlink(name, failure);
    const fs::path resolved = fs::weakly_canonical(name, failure);
    return (failure ? name.lexically_normal() : resolved).string();
}

/// TetGen's meshes are two files that are read together.
std::string companion(const std::string& path) {
    fs::path other(path);
    if (other.extension() == ".node") return other.replace_extension(".ele").string();
    if (other.extension() == ".ele") return other.replace_extension(".node").string();
    return {};
}

/// ".a, .b or .c"
std::string listEndings(const std::vector<std::string>& kinds) {
    std::string text;
    for (std::size_t i = 0; i < kinds.size(); ++i)
        text += (i == 0 ? "." : i + 1 == kinds.size() ? " or ." : ", .") + kinds[i];
    return text;
}

}  // namespace

std::string chooseFormat(const std::string& output, const std::string& format,
                         const std::vector<std::string>& kinds) {
    if (output == kStandardOutput) return format.empty() ? kinds.front() : format;
    if (!format.empty())
        throw InputError(fmt::format(
            "--format is for standard output (-o -): the ending of {} says what to write", output));
    std::string ending = fs::path(output).extension().string();
    for (char& c : ending) c = char(std::tolower(static_cast<unsigned char>(c)));
    for (const std::string& kind : kinds)
        if (ending == "." + kind) return kind;
    throw InputError(fmt::format("{}: the ending says what to write: expected {}, got {}", output,
                                 listEndings(kinds), ending.empty() ? "none" : "'" + ending + "'"));
}

void checkReportPath(const Job& job) {
    if (!job.reportPath.empty() && job.reportPath != kStandardOutput) checkWritable(job.reportPath);
}

void checkOutputPaths(const std::vector<std::string>& inputs, const std::vector<OutputPath>& outputs) {
    std::map<std::string, std::string> used;  // what each file is used for
    const auto useInput = [&](const std::string& input) {
        for (const std::string& path : {input, companion(input)})
            if (!path.empty()) used.emplace(fileKey(path), "the input " + path);
    };
    for (const std::string& input : inputs) {
        useInput(input);
        if (!isCollectionName(input)) continue;
        for (const SeriesStep& step : listSeries(std::span(&input, 1)))
            for (const std::string& file : step.files) useInput(file);
    }
    for (const OutputPath& output : outputs) {
        if (output.path.empty()) continue;
        if (output.path == kStandardOutput) {
            const auto [before, isFirst] = used.emplace(kStandardOutput, output.option);
            if (!isFirst)
                throw InputError(
                    fmt::format("{} and {} can't both be standard output", before->second, output.option));
            continue;
        }
        const auto [before, isNew] =
            used.emplace(fileKey(output.path), fmt::format("the {} file {}", output.option, output.path));
        if (!isNew)
            throw InputError(
                fmt::format("{}: {} would replace {}", output.path, output.option, before->second));
    }
}

}  // namespace tessera
