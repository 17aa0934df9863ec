#pragma once

#include <gtest/gtest.h>
#include <hwy/highway.h>

namespace tessera {

/// Calls check() for each instruction set.
template <class Check>
void onEveryTarget(const Check& check) {
    for (const auto target : hwy::SupportedAndGeneratedTargets()) {
        SCOPED_TRACE(hwy::TargetName(target));
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        check();
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace tessera
