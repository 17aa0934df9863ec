#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace tessera {

/// What one call of a resampler did: named counts, which are exact, and named stages in milliseconds of wall
/// clock, which may overlap. Each algorithm has its own.
class ResampleStatistics {
  public:
    template <class Value>
    struct Entry {
        std::string_view name;
        Value value;
    };

    /// 0 for a name that wasn't added.
    std::int64_t count(std::string_view name) const;
    double ms(std::string_view stage) const;

    /// Names must live as long as the program: literals.
    void add(std::string_view name, std::int64_t value);
    void addMs(std::string_view stage, double ms);
    void setMs(std::string_view stage, double ms);

    /// In the order in which they were added first.
    const std::vector<Entry<std::int64_t>>& counts() const { return counts_; }
    const std::vector<Entry<double>>& stages() const { return stages_; }

    ResampleStatistics& operator+=(const ResampleStatistics& other);

  private:
    std::vector<Entry<std::int64_t>> counts_;
    std::vector<Entry<double>> stages_;
};

}  // namespace tessera
