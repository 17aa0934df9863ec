#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <limits>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "base/check.h"
#include "base/floor_div.h"
#include "base/machine_memory.h"
#include "base/parallel.h"
#include "base/round_numbers.h"
#include "base/timer.h"
#include "tessera/error.h"
#include "tessera/execution.h"
#include "tessera/vec.h"

namespace tessera {
namespace {

TEST(ParallelFor, VisitsEveryItemOnceForAnyThreadCount) {
    for (const int threads : {1, 2, 5, 16}) {
        Execution execution;
        execution.threads = threads;
        std::vector<std::atomic<int>> visits(1000);
        parallelFor(execution, 1000, [&](std::int64_t i) { ++visits[std::size_t(i)]; });
        for (const auto& visit : visits) EXPECT_EQ(visit, 1);
    }
}

TEST(ParallelFor, RethrowsTheBodysException) {
    for (const int threads : {1, 4}) {
        Execution execution;
        execution.threads = threads;
        EXPECT_THROW(parallelFor(execution, 100,
                                 [](std::int64_t i) {
                                     if (i == 50) throw InputError("fifty");
                                 }),
                     InputError);
    }
}

TEST(ParallelFor, StopsWhenCancelled) {
    for (const int threads : {1, 4}) {
        std::atomic<bool> cancel{false};
        std::atomic<int> done{0};
        Execution execution;
        execution.threads = threads;
        execution.cancel = &cancel;
        EXPECT_THROW(parallelFor(execution, 100000,
                                 [&](std::int64_t) {
                                     if (++done == 10) cancel = true;
                                 }),
                     Cancelled);
        EXPECT_LT(done, 1000);
    }
}

TEST(ParallelFor, UsesSeveralThreadsWhenAsked) {
    Execution execution;
    execution.threads = 4;
    std::mutex mutex;
    std::set<std::thread::id> seen;
    std::atomic<int> waiting{0};
    // Every item waits until a second thread has arrived, so one thread alone could not finish.
    parallelFor(execution, 2, [&](std::int64_t) {
        ++waiting;
        while (waiting < 2) std::this_thread::yield();
        std::lock_guard lock(mutex);
        seen.insert(std::this_thread::get_id());
    });
    EXPECT_EQ(seen.size(), 2u);
}

TEST(ParallelForChunks, ChunkBordersDoNotDependOnThreads) {
    for (const int threads : {1, 3, 16}) {
        Execution execution;
        execution.threads = threads;
        std::mutex mutex;
        std::set<std::pair<std::int64_t, std::int64_t>> chunks;
        parallelForChunks(execution, 25, 10, [&](std::int64_t begin, std::int64_t end) {
            std::lock_guard lock(mutex);
            chunks.insert({begin, end});
        });
        EXPECT_EQ(chunks, (std::set<std::pair<std::int64_t, std::int64_t>>{{0, 10}, {10, 20}, {20, 25}}));
    }
}

TEST(Check, NamesTheConditionAndThePlace) {
    try {
        TESSERA_CHECK(1 + 1 == 3, "arithmetic");
        FAIL();
    } catch (const InternalError& error) {
        EXPECT_NE(std::string(error.what()).find("1 + 1 == 3"), std::string::npos);
        EXPECT_NE(std::string(error.what()).find("base_test.cpp"), std::string::npos);
    }
}

TEST(FloorDiv, RoundsTowardsMinusInfinity) {
    EXPECT_EQ(floorDiv(7, 4), 1);
    EXPECT_EQ(floorDiv(-1, 4), -1);
    EXPECT_EQ(floorDiv(-4, 4), -1);
    EXPECT_EQ(floorDiv(-5, 4), -2);
}

TEST(RoundNumbers, AreOneTwoAndFiveTimesPowersOfTen) {
    EXPECT_DOUBLE_EQ(roundLengthBelow(7), 5);
    EXPECT_DOUBLE_EQ(roundLengthBelow(0.0499), 0.02);
    EXPECT_DOUBLE_EQ(roundLengthBelow(1000), 1000);
    EXPECT_DOUBLE_EQ(roundLengthBelow(0.3 - 0.1), 0.2);
    EXPECT_DOUBLE_EQ(roundLengthAbove(7), 10);
    EXPECT_DOUBLE_EQ(roundLengthAbove(0.011), 0.02);
    EXPECT_DOUBLE_EQ(roundLengthAbove(1e-9), 1e-9);
    EXPECT_EQ(roundNumberText(3 * 0.1, 0.1), "0.3");
    EXPECT_EQ(roundNumberText(-1e-17, 0.5), "0");
    EXPECT_EQ(roundNumberText(1500, 500), "1500");
    EXPECT_EQ(roundNumberText(2, 0.05), "2.00");
    EXPECT_EQ(roundNumberText(3e-7, 1e-7), "3e-07");
    EXPECT_EQ(roundNumberText(1.5e9, 5e8), "1.5e+09");
}

TEST(PeakMemory, GrowsWithWhatIsUsed) {
    const long long before = peakMemoryBytes();
    std::vector<char> block(std::size_t(64) << 20, 1);
    // A compiler may leave out an allocation that nobody looks at.
    const volatile char* last = &block.back();
    EXPECT_GE(peakMemoryBytes() + *last, before + (32 << 20));
}

/// A folder that looks like the one where control groups are mounted.
class ControlGroups : public testing::Test {
  protected:
    ControlGroups()
        : mount_(std::filesystem::path(testing::TempDir()) / ("groups_" + std::to_string(::getpid()))) {}
    ~ControlGroups() override { std::filesystem::remove_all(mount_); }

    void bound(const std::string& name, const std::string& text) const {
        std::filesystem::create_directories((mount_ / name).parent_path());
        std::ofstream(mount_ / name) << text << "\n";
    }
    std::int64_t bytes(const std::string& groups) const { return groupMemoryBytes(groups, mount_.string()); }

    const std::int64_t none = std::numeric_limits<std::int64_t>::max();

  private:
    std::filesystem::path mount_;
};

TEST_F(ControlGroups, TheLeastBoundOfAGroupAndThoseAboveItHolds) {
    bound("system.slice/memory.max", "3000000000");
    bound("system.slice/a.service/memory.max", "max");
    EXPECT_EQ(bytes("0::/system.slice/a.service\n"), 3000000000);
    bound("system.slice/a.service/memory.max", "1000000");
    EXPECT_EQ(bytes("0::/system.slice/a.service\n"), 1000000);
    EXPECT_EQ(bytes("0::/system.slice\n"), 3000000000);
    EXPECT_EQ(bytes("0::/user.slice\n"), none);
}

TEST_F(ControlGroups, InAContainerTheMountIsTheGroup) {
    bound("memory.max", "2000000");
    EXPECT_EQ(bytes("0::/\n"), 2000000);
    EXPECT_EQ(bytes("0::/docker/of/the/host\n"), 2000000);
    EXPECT_EQ(bytes("0::/../other\n"), 2000000);
}

TEST_F(ControlGroups, OfVersionOneTheControllerOfMemoryCounts) {
    bound("memory/job/memory.limit_in_bytes", "5000000");
    bound("memory/memory.limit_in_bytes", "9223372036854771712");
    bound("cpu/job/memory.limit_in_bytes", "1");
    EXPECT_EQ(bytes("11:cpu,cpuacct:/job\n7:memory:/job\n1:name=systemd:/x\n"), 5000000);
    EXPECT_EQ(bytes("7:hugetlb,memory:/job/step\n"), 5000000);
    EXPECT_EQ(bytes("7:memory:/\n"), 9223372036854771712);
}

TEST_F(ControlGroups, WithoutGroupsThereIsNoBound) {
    for (const char* groups : {"", "\n", "nonsense", "0::", "1:memory", "0::relative\n"})
        EXPECT_EQ(bytes(groups), none) << groups;
    EXPECT_GT(machineMemoryBytes(), 1 << 20);
    EXPECT_EQ(defaultMemoryBytes(), machineMemoryBytes() / 4 * 3);
}

}  // namespace
}  // namespace tessera
