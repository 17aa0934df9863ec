// Runs a fuzz target over its stored inputs, without libFuzzer: what was found once is tested by every
// compiler.

#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int argc, char** argv) {
    int inputs = 0, failures = 0;
    for (int i = 1; i < argc; ++i) {
        for (const auto& entry : std::filesystem::directory_iterator(argv[i])) {
            std::ifstream file(entry.path(), std::ios::binary);
            const std::string bytes{std::istreambuf_iterator<char>(file), {}};
            ++inputs;
            try {
                LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
            } catch (const std::exception& error) {
                std::printf("%s: %s\n", entry.path().c_str(), error.what());
                ++failures;
            }
        }
    }
    std::printf("%d inputs, %d failures\n", inputs, failures);
    return inputs == 0 || failures > 0;
}
