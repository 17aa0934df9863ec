#include "tessera/execution.h"

#include <algorithm>
#include <thread>

#include "tessera/error.h"

namespace tessera {

int Execution::threadCount() const {
    if (threads > 0) return threads;
    return std::max(1, int(std::thread::hardware_concurrency()));
}

void Execution::throwIfCancelled() const {
    if (cancel && cancel->load(std::memory_order_relaxed)) throw Cancelled();
}

}  // namespace tessera
