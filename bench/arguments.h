#pragma once

#include <functional>
#include <memory>
#include <string>

namespace tessera::bench {

/// What a number may be.
struct Range {
    int least = 0, most = 0;
};

/// The words of a program's command line. CLI11 reads them; it is slow to compile and stands in one source.
class Arguments {
  public:
    /// @param about what the program does, for --help.
    explicit Arguments(const std::string& about);
    ~Arguments();
    /// Text, a number, yes or no (an option without a value), or a list of text or numbers, separated by
    /// commas after an option. @param names "--runs", or "mesh" for words without an option. Defined for the
    /// types that arguments.cpp names.
    template <class Value>
    void add(const std::string& names, Value& value, const std::string& help = {});
    void add(const std::string& names, int& value, const std::string& help, const Range& range);
    /// The same, for words that can't be left out.
    template <class Value>
    void addNeeded(const std::string& names, Value& value, const std::string& help);
    /// Reads the words, then runs the program. Returns its exit code: what `program` returns; 1 after an
    /// exception, whose text is printed.
    int run(int count, char** words, const std::function<int()>& program);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::bench
