#include "job/algorithm_choice.h"

#include "gl/gl_platform.h"

namespace tessera {

AlgorithmChoice::AlgorithmChoice(const std::string& name, const BindOptions& options, Job& job)
    : options_(options), job_(job) {
    if (name == "auto") {
        checkGlTarget(options.target);
        return;
    }
    choice_ = chooseResampler(name, options);
    warnOfDrivers(job);
}

void AlgorithmChoice::chooseFor(const WorkSize& work) {
    if (choice_.resampler) return;
    choice_ = chooseResampler("auto", options_, work, job_.execution);
    job_.say(choice_.reason + "\n");
    warnOfDrivers(job_);
}

void warnOfDrivers(Job& job) {
    if (const std::string faults = glFaults(); !faults.empty()) job.warn(faults);
}

void checkGlTarget(const std::string& target) {
    for (const GlPlatform platform : glPlatforms())
        if (nameOf(platform) == target) throwIfUnavailable(platform);
}

}  // namespace tessera
