// Adds the oracle to the algorithms of the program that this is linked into.

#include "contract/oracle_resampler.h"
#include "tessera/registry.h"

namespace {

[[maybe_unused]] const bool isRegistered = [] {
    tessera::registerResampler(std::make_unique<tessera::contract::OracleResampler>());
    return true;
}();

}  // namespace
