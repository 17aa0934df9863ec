#pragma once

#include <string>

namespace tessera {

/// The largest of 1, 2 and 5 times powers of ten that isn't above a length above 0.
double roundLengthBelow(double length);
/// The smallest of them that isn't below it.
double roundLengthAbove(double length);

/// A multiple of a step of those, with as many digits as the step asks for.
std::string roundNumberText(double value, double step);

}  // namespace tessera
