#pragma once

namespace tessera {

/// What a machine's memory and arithmetic allow so many threads; GB/s of bytes read and written.
struct MachineRates {
    int threads = 1;
    double fill = 0;                        ///< memory that is there
    double copy = 0;                        ///< read and written counted
    double touchSmall = 0, touchLarge = 0;  ///< first touch of fresh pages, small and large ones
    double stepsMs = 0;                     ///< multiply-adds of doubles a millisecond that need no memory
};

/// Medians of so many runs over 256 MiB; half a GiB is held meanwhile.
MachineRates measureMachine(int threads, int runs);

/// A fixed piece of work, some 20 ms of arithmetic and memory by so many threads, that has nothing to do with
/// what is measured: how long it takes says how busy the machine is. Milliseconds.
double runYardstick(int threads);

}  // namespace tessera
