#include "job/algorithm_choice.h"

#include "gl/gl_platform.h"

namespace tessera {

AlgorithmChoice::AlgorithmChoice(const std::string& name, const BindOptions& options, Job& job)
    : options_(options), job_(job) {
    if (name == "auto") checkGlTarget(options.target);
    choice_ = chooseResampler(name, options);
    if (!choice_.reason.empty()) job.say(choice_.reason + "\n");
    warnOfDrivers(job);
}

void warnOfDrivers(Job& job) {
    if (const std::string faults = glFaults(); !faults.empty()) job.warn(faults);
}

void checkGlTarget(const std::string& target) {
    for (const GlPlatform platform : glPlatforms())
        if (nameOf(platform) == target) throwIfUnavailable(platform);
}

}  // namespace tessera
