#pragma once

#include <string>

#include "job/job.h"
#include "tessera/registry.h"

namespace tessera {

/// The resampler that a job works with. Where "auto" chose one on a device and that fails, the job goes on
/// with the quickest that needs none.
class AlgorithmChoice {
  public:
    /// Throws what chooseResampler does for an algorithm that is named, and GlError when "auto" is to take an
    /// OpenGL platform that can't be had.
    AlgorithmChoice(const std::string& name, const BindOptions& options, Job& job);

    /// To be called before all else: has "auto" choose, by the first work that it gets, and says what it
    /// chose. Warns of drivers that crashed or stalled. Throws what chooseResampler does.
    void chooseFor(const WorkSize& work);

    const Resampler& resampler() const { return *choice_.resampler; }
    const std::string& reason() const { return choice_.reason; }

    /// work(resampler), and once more from its beginning where OpenGL fails on the way and "auto" can choose
    /// another resampler. That is a warning then.
    template <class Work>
    auto run(const Work& work) {
        const Resampler* first = choice_.resampler;
        return runChosen(choice_, [&](const Resampler& resampler) {
            if (&resampler != first) job_.warn(choice_.reason);
            return work(resampler);
        });
    }

  private:
    BindOptions options_;
    Job& job_;
    ResamplerChoice choice_;
};

/// Warns of drivers of OpenGL that crashed or stalled when they were tried.
void warnOfDrivers(Job& job);

/// Throws GlError with the reason when `target` is an OpenGL platform that can't be had.
void checkGlTarget(const std::string& target);

}  // namespace tessera
