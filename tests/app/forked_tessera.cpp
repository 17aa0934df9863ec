// Runs many command lines of tessera, each in a process of its own that starts from this one: loading the
// libraries takes ten times as long as most runs of a test. forked_tessera.py is its other end.
//
// A request on standard input: the length of what follows, 32 bits; then, each ended by a zero, the folder to
// run in, files for standard output and standard error, and the words of the command line. The answer on
// standard output: the exit status as waitpid() gives it, 32 bits; microseconds of processor time and the
// largest resident memory in KiB, its children's included, 64 bits each.

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#define main tesseraMain
#include "main.cpp"
#undef main

namespace {

bool readAll(void* to, std::size_t size) {
    auto* at = static_cast<char*>(to);
    while (size > 0) {
        const ssize_t count = ::read(STDIN_FILENO, at, size);
        if (count <= 0) return false;
        at += count;
        size -= std::size_t(count);
    }
    return true;
}

void redirect(int stream, const char* path, int flags) {
    const int file = ::open(path, flags | O_CLOEXEC, 0600);
    if (file < 0 || ::dup2(file, stream) < 0) _exit(127);
}

[[noreturn]] void runInFolder(std::vector<char*> words) {
    if (::chdir(words[0]) != 0) _exit(127);
    redirect(STDIN_FILENO, "/dev/null", O_RDONLY);
    redirect(STDOUT_FILENO, words[1], O_WRONLY | O_CREAT | O_TRUNC);
    redirect(STDERR_FILENO, words[2], O_WRONLY | O_CREAT | O_TRUNC);
    words.push_back(nullptr);
    words[2] = const_cast<char*>("tessera");
    const int code = tesseraMain(int(words.size()) - 3, words.data() + 2);
    // Without what libraries do at the end of a program: one waits for its threads, which stayed with the
    // parent.
    std::fflush(nullptr);
    _exit(code);
}

}  // namespace

int main(int argc, char** argv) {
    // The process that reads a mesh is started by this program's path.
    if (argc > 1) return tesseraMain(argc, argv);
    std::uint32_t size = 0;
    while (readAll(&size, sizeof size)) {
        std::string request(size, '\0');
        if (!readAll(request.data(), size)) return 1;
        std::vector<char*> words;
        for (std::size_t at = 0; at < request.size(); at = request.find('\0', at) + 1)
            words.push_back(request.data() + at);
        if (words.size() < 3) return 1;
        const pid_t child = ::fork();
        if (child == 0) runInFolder(words);
        int status = -1;
        rusage usage{};
        if (child < 0 || ::wait4(child, &status, 0, &usage) != child) return 1;
        const auto microseconds = [](const timeval& t) {
            return t.tv_sec * std::int64_t(1000000) + t.tv_usec;
        };
        std::array<char, 20> answer;
        const std::array<std::int64_t, 2> used{microseconds(usage.ru_utime) + microseconds(usage.ru_stime),
                                               usage.ru_maxrss};
        std::memcpy(answer.data(), &status, 4);
        std::memcpy(answer.data() + 4, used.data(), 16);
        if (::write(STDOUT_FILENO, answer.data(), answer.size()) != ssize_t(answer.size())) return 1;
    }
}
