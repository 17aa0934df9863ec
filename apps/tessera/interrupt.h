#pragma once

#include <atomic>

namespace tessera {

/// Turns the first SIGINT or SIGTERM into a raised flag, which ends the work in order. The second one ends
/// the process at once, after removing unfinished files.
void installInterruptHandlers();
/// True after a signal.
const std::atomic<bool>& interruptFlag();
/// The signal that came, or 0.
int interruptSignal();

}  // namespace tessera
