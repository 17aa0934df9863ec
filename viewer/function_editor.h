#pragma once

#include "view/view_session.h"

namespace tessera {

/// Edits opacities over the histogram of the values: drag a point; a click beside the line makes one, a right
/// click takes it away. True while something is dragged.
bool editFunction(ViewSession& session);

}  // namespace tessera
