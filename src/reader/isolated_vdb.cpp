#include "reader/isolated_vdb.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "tessera/error.h"
#include "vdb/vdb_read.h"

namespace tessera {

namespace {

constexpr const char* kWhole = "vdb";
constexpr const char* kWithoutValues = "vdb-without-values";
constexpr const char* kLattice = "vdb-lattice";
constexpr const char* kSamples = "vdb-samples";

/// OpenVDB needs no companion files, so none is asked for.
void ask(IsolatedReader reader, const std::string& path, const char* task, std::string body,
         const IsolationLimits& limits, const Execution& execution, const TakeAnswer& take) {
    reader.quickExecutable.clear();
    ReaderRequest request;
    request.path = path;
    request.task = task;
    request.body = std::move(body);
    askReader(reader, std::move(request), path, limits, execution, take);
}

template <class Item>
void putArray(HeadWriter& head, std::span<const Item> items) {
    head.put(std::string(reinterpret_cast<const char*>(items.data()), items.size_bytes()));
}

template <class Item>
std::vector<Item> getArray(HeadReader& head) {
    const std::string bytes = head.getText();
    std::vector<Item> items(bytes.size() / sizeof(Item));
    if (items.size() * sizeof(Item) != bytes.size()) throw DamagedPacket("an array isn't whole");
    if (!items.empty()) std::memcpy(items.data(), bytes.data(), bytes.size());
    return items;
}

std::string encodeQuestions(std::span<const std::vector<GridPlace>> places,
                            std::span<const GridQuestion> questions) {
    HeadWriter body;
    body.put(std::int64_t(places.size()));
    for (const std::vector<GridPlace>& list : places) putArray(body, std::span(list));
    body.put(std::int64_t(questions.size()));
    for (const GridQuestion& question : questions) {
        body.put(question.grid);
        body.put(std::int64_t(question.components));
        body.put(std::int64_t(question.places));
    }
    return body.take();
}

Packet answerQuestions(const ReaderRequest& request) {
    HeadReader body(std::as_bytes(std::span(request.body)));
    const auto most = std::int64_t(request.body.size());
    std::vector<std::vector<GridPlace>> places(std::size_t(body.getCount(most, "lists of places")));
    for (std::vector<GridPlace>& list : places) list = getArray<GridPlace>(body);
    std::vector<GridQuestion> questions(std::size_t(body.getCount(most, "questions")));
    for (GridQuestion& question : questions) {
        question.grid = body.getText();
        question.components = int(body.getCount(3, "components"));
        question.places = std::size_t(body.getCount(std::int64_t(places.size()) - 1, "as a list"));
    }
    auto answers =
        std::make_shared<std::vector<std::vector<GridReading>>>(sampleGrids(request.path, places, questions));
    HeadWriter head;
    Packet packet;
    for (const std::vector<GridReading>& readings : *answers) {
        head.put(std::int64_t(readings.size()));
        packet.arrayBytes += std::int64_t(readings.size() * sizeof(GridReading));
    }
    packet.head = head.take();
    packet.writeArrays = [answers](const PacketSink& sink) {
        for (const std::vector<GridReading>& readings : *answers)
            if (!readings.empty()) sink(readings.data(), readings.size() * sizeof(GridReading));
    };
    return packet;
}

Packet packLattice(const FixedFrame& frame) {
    HeadWriter head;
    for (const double number :
         {frame.originWorld.x, frame.originWorld.y, frame.originWorld.z, frame.spacingWorld})
        head.put(number);
    Packet packet;
    packet.head = head.take();
    return packet;
}

/// The same task, in which OpenVDB has no more threads than those that its memory allows.
ReaderTask inThreads(ReaderTask task) {
    task.run = [run = std::move(task.run)](const ReaderRequest& request, const IsolationLimits& limits,
                                           const Execution& execution) {
        const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                          std::size_t(execution.threads));
        return run(request, limits, execution);
    };
    return task;
}

}  // namespace

VdbFile readVdbIsolated(const IsolatedReader& reader, const std::string& path, VdbContents contents,
                        const IsolationLimits& limits, const Execution& execution) {
    VdbFile file;
    ask(reader, path, contents == VdbContents::all ? kWhole : kWithoutValues, {}, limits, execution,
        [&](std::span<const std::byte> packet, std::int64_t mostBytes) {
            // One file: what the other process says of its size needn't be believed.
            const std::int64_t usual = std::max(limits.memoryBytes, limitsOfVdb(path).memoryBytes);
            file = unpackVdb(packet, std::min(mostBytes, usual / kHandedOverShare), execution);
        });
    return file;
}

FixedFrame readVdbLatticeIsolated(const IsolatedReader& reader, const std::string& path,
                                  const IsolationLimits& limits, const Execution& execution) {
    FixedFrame frame;
    ask(reader, path, kLattice, {}, limits, execution, [&](std::span<const std::byte> packet, std::int64_t) {
        HeadReader head = ReceivedPacket(packet).head();
        for (double* number :
             {&frame.originWorld.x, &frame.originWorld.y, &frame.originWorld.z, &frame.spacingWorld}) {
            *number = head.get<double>();
            if (!std::isfinite(*number)) throw DamagedPacket("a number isn't finite");
        }
        head.expectEnd();
    });
    return frame;
}

GridSampler isolatedGridSampler(const IsolatedReader& reader, const IsolationLimits& limits,
                                const Execution& execution) {
    return [&](const std::string& path, std::span<const std::vector<GridPlace>> places,
               std::span<const GridQuestion> questions) {
        std::vector<std::vector<GridReading>> answers;
        const auto take = [&](std::span<const std::byte> bytes, std::int64_t) {
            ReceivedPacket packet(bytes);
            HeadReader head = packet.head();
            for (const GridQuestion& question : questions) {
                const auto asked = std::int64_t(places[question.places].size());
                const std::int64_t count = head.getCount(asked, "readings");
                if (count != 0 && count != asked) throw DamagedPacket("readings are missing");
                answers.push_back(packet.copy<GridReading>(count, "readings"));
            }
            head.expectEnd();
            packet.expectEnd();
        };
        ask(reader, path, kSamples, encodeQuestions(places, questions), limits, execution, take);
        return answers;
    };
}

std::vector<ReaderTask> vdbTasks() {
    const auto limits = [](const ReaderRequest& request) { return limitsOfVdb(request.path); };
    const auto reads = [&](const char* name, VdbContents contents) {
        return inThreads(
            {name, limits,
             [contents](const ReaderRequest& request, const IsolationLimits& bounds, const Execution&) {
                 return packVdb(readVdb(request.path), contents, bounds.memoryBytes / kHandedOverShare);
             }});
    };
    const auto withPlaces = [](const ReaderRequest& request) {
        IsolationLimits bounds = limitsOfVdb(request.path);
        // What is asked and answered comes on top.
        bounds.memoryBytes += 4 * std::int64_t(request.body.size());
        return bounds;
    };
    return {reads(kWhole, VdbContents::all), reads(kWithoutValues, VdbContents::withoutValues),
            inThreads({kLattice, limits,
                       [](const ReaderRequest& request, const IsolationLimits&, const Execution&) {
                           return packLattice(readVdbLattice(request.path));
                       }}),
            inThreads({kSamples, withPlaces,
                       [](const ReaderRequest& request, const IsolationLimits&, const Execution&) {
                           return answerQuestions(request);
                       }})};
}

}  // namespace tessera
