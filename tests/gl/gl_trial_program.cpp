// What gl_trial_test starts: no more than a trial of OpenGL, or with "deaf" a program that knows of none.
#include <string>
#include <vector>

#include "gl/gl_trial.h"

int main(int argc, char** argv) {
    const std::vector<std::string> words(argv + 1, argv + argc);
    if (words.empty() || words[0] == "deaf") return 2;
    return tessera::serveGlTrial(words);
}
