#include "arguments.h"

#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <vector>

namespace tessera::bench {

struct Arguments::Impl {
    CLI::App app;
    template <class Value>
    CLI::Option* add(const std::string& names, Value& value, const std::string& help) {
        if constexpr (std::is_same_v<Value, bool>)
            return app.add_flag(names, value, help);
        else
            return app.add_option(names, value, help);
    }
    template <class Item>
    CLI::Option* add(const std::string& names, std::vector<Item>& values, const std::string& help) {
        CLI::Option* option = app.add_option(names, values, help);
        return names.starts_with('-') ? option->delimiter(',') : option;
    }
};

Arguments::Arguments(const std::string& about) : impl_(new Impl{CLI::App(about)}) {}
Arguments::~Arguments() = default;

template <class Value>
void Arguments::add(const std::string& names, Value& value, const std::string& help) {
    impl_->add(names, value, help);
}

template <class Value>
void Arguments::addNeeded(const std::string& names, Value& value, const std::string& help) {
    impl_->add(names, value, help)->required();
}

void Arguments::add(const std::string& names, int& value, const std::string& help, const Range& range) {
    impl_->add(names, value, help)->check(CLI::Range(range.least, range.most));
}

int Arguments::run(int count, char** words, const std::function<int()>& program) {
    CLI11_PARSE(impl_->app, count, words);
    try {
        return program();
    } catch (const std::exception& error) {
        const std::string name = std::filesystem::path(words[0]).filename().string();
        std::fprintf(stderr, "%s: %s\n", name.c_str(), error.what());
        return 1;
    }
}

template void Arguments::add(const std::string&, std::string&, const std::string&);
template void Arguments::add(const std::string&, double&, const std::string&);
template void Arguments::add(const std::string&, int&, const std::string&);
template void Arguments::add(const std::string&, bool&, const std::string&);
template void Arguments::add(const std::string&, std::int64_t&, const std::string&);
template void Arguments::add(const std::string&, std::uint64_t&, const std::string&);
template void Arguments::add(const std::string&, std::vector<std::string>&, const std::string&);
template void Arguments::add(const std::string&, std::vector<int>&, const std::string&);
template void Arguments::add(const std::string&, std::vector<std::int64_t>&, const std::string&);
template void Arguments::addNeeded(const std::string&, std::string&, const std::string&);
template void Arguments::addNeeded(const std::string&, std::vector<std::string>&, const std::string&);

}  // namespace tessera::bench
