#pragma once

#include <cstdint>
#include <vector>

#include "mesh/tet_complex.h"

namespace tessera {

/// Turns flat elements so that they continue the orientation of their neighbours through shared faces: then
/// what is exactly flat can be told apart from what is folded over. @param flat living elements of zero
/// volume; all others are positively oriented.
void orientFlatElements(TetComplex& complex, const std::vector<std::int32_t>& flat);

/// Whether a flat element can be taken away without two faces of its neighbours meeting there: none or only
/// faces of one of its sides are shared, or those shared have their two elements without it.
bool isLooseFlatElement(const TetComplex& complex, std::int32_t element);

}  // namespace tessera
