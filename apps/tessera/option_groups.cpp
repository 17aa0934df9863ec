#include "option_groups.h"

#include <fmt/format.h>

#include <charconv>
#include <sstream>

#include "job/wrap_text.h"
#include "terminal.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kHelpColumn = 34;  // where descriptions begin

/// Lines that a terminal would break anywhere, broken between words. Descriptions stay in their column.
std::string wrapHelp(const std::string& text) {
    std::istringstream lines(text);
    std::string wrapped;
    const auto width = std::size_t(outputWidth());
    for (std::string line; std::getline(lines, line);) {
        const bool isOption = line.size() > kHelpColumn && line.starts_with(' ') &&
                              line[kHelpColumn - 1] == ' ' && line[kHelpColumn] != ' ';
        const std::size_t indent = std::min(line.find_first_not_of(' '), line.size());
        wrapped += wrapLine(line, width, isOption ? kHelpColumn : indent) + "\n";
    }
    return wrapped;
}

}  // namespace

CLI::Validator numbersWithin(double first, double last) {
    const auto check = [first, last](std::string& text) {
        double value = 0;
        const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
        const bool isNumber = failure == std::errc{} && end == text.data() + text.size();
        return isNumber && value >= first && value <= last
                   ? std::string()
                   : fmt::format("expected {:g} to {:g}, got '{}'", first, last, text);
    };
    return {check, fmt::format("in [{:g} - {:g}]", first, last), ""};
}

CLI::Validator isLength() {
    return numbersWithin(1e-300, 1e300);
}

void addRunOptions(CLI::App& command, CommonOptions& options) {
    command
        .add_option("--threads", options.threads,
                    "worker threads (default: one for every processor); the result never depends on it")
        ->check(CLI::Range(0, 1024));
    command.add_flag("-q,--quiet", options.quiet,
                     "print nothing but errors, and a warning where a result isn't what was asked for");
    command.add_option("--json", options.jsonPath,
                       "write a report as JSON to this file, or to standard output for -");
}

void nameProgram(CLI::App& app, const std::string& name, const std::string& version) {
    app.name(name);
    app.set_version_flag("--version", version);
    app.set_help_flag("-h,--help", "print this help and exit");
    app.get_formatter()->column_width(kHelpColumn);
}

void parseWords(CLI::App& app, int argc, char** argv, CommandLine& line) {
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        if (error.get_exit_code() != 0)
            throw InputError(fmt::format("{} ({} --help tells more)", error.what(), app.get_name()));
        std::ostringstream text;
        app.exit(error, text);
        line.text = wrapHelp(text.str());
    }
}

}  // namespace tessera
