#pragma once

#include <array>
#include <string>
#include <vector>

namespace tessera {

/// How a value is shown: colour and opacity, linear between stops and constant beyond the first and the last.
/// Two stops of one value make a step.
struct TransferFunction {
    struct Stop {
        /// In the field's unit.
        double value = 0;
        /// Red, green, blue from 0 to 1, not multiplied by the opacity.
        std::array<double, 3> color{1, 1, 1};
        /// From 0, unseen, to 1.
        double opacity = 0;
    };
    /// The field, "" for the first; a vector's first component counts.
    std::string field;
    /// Ascending by value, one at least.
    std::vector<Stop> stops;

    friend bool operator==(const TransferFunction&, const TransferFunction&);
};

/// The stop at a value from that of one stop to that of another: linear between them.
TransferFunction::Stop between(const TransferFunction::Stop& below, const TransferFunction::Stop& above,
                               double value);

/// What a stop looks like: red, green and blue, each multiplied by the opacity, and the opacity.
std::array<double, 4> shownAs(const TransferFunction::Stop& stop);
/// The same of a finite value; at a step, of what stands above it.
std::array<double, 4> shownAt(const TransferFunction& function, double value);

/// Whether some value from `low` to `high` has an opacity above 0.
bool showsAny(const TransferFunction& function, double low, double high);

/// Throws InputError for stops out of order or out of range, and for none.
void checkTransferFunction(const TransferFunction& function);

}  // namespace tessera
