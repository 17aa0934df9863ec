#include "reader/reader_limits.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "base/machine_memory.h"
#include "files/input_file.h"
#include "files/named_file.h"
#include "mesh_files/ensight_check.h"
#include "mesh_files/legacy_check.h"
#include "mesh_files/xml_check.h"

namespace tessera {

namespace {

// Measured: reading a mesh of tetrahedra takes 10 to 20 bytes for each of a compressed file, and 190 an
// element; a grid's point becomes five or six elements. The factors leave room for meshes that compress
// better.
constexpr double kFloorBytes = 640.0 * (1 << 20), kBytesPerFileByte = 96, kBytesPerItem = 700;
// OpenVDB needs a dozen bytes for a byte of file, and 40 where all values are the same.
constexpr double kVdbFloorBytes = 192.0 * (1 << 20);
constexpr double kFloorSeconds = 3, kSecondsPerFileByte = 0.25e-6, kSecondsPerItem = 20e-6;
// The program that reads, before there is a mesh.
constexpr std::int64_t kReaderBytes = std::int64_t(24) << 20;
// Others may have the processors, and disks may be slow.
constexpr double kFloorWaitSeconds = 60, kWaitShare = 10;
constexpr double kLookSeconds = 20;
// Below, a file's own word on its cells is worth nothing: its size alone bounds what it may take.
constexpr std::int64_t kSmallFile = 8 << 20;
constexpr int kMostFiles = 100000;
constexpr std::size_t kHeadBytes = 4096;

struct InputSize {
    double bytes = 0;
    double items = 0;  ///< cells, or points of a structured grid
};

std::int64_t sizeOf(const std::filesystem::path& path) {
    std::error_code error;
    const auto bytes = std::filesystem::file_size(path, error);
    return error ? 0 : std::int64_t(bytes);
}

/// Everything below the folder of a marker file.
double bytesOfFolder(const std::filesystem::path& folder) {
    using Iterator = std::filesystem::recursive_directory_iterator;
    double bytes = 0;
    int files = 0;
    std::error_code error;
    for (Iterator entry(folder.empty() ? "." : folder, error), end;
         !error && entry != end && files < kMostFiles; entry.increment(error), ++files)
        bytes += double(sizeOf(entry->path()));
    return bytes;
}

InputSize sizeOfInput(const std::string& path, const std::optional<std::string>& folder) {
    const std::filesystem::path given(path);
    const std::string extension = extensionOf(path);
    std::error_code error;
    if (extension == ".foam" && std::filesystem::exists(given, error))
        return {bytesOfFolder(given.parent_path()), 0};
    InputFile file(path);
    const std::string head = file.copy(0, kHeadBytes);
    const bool isLegacy = head.starts_with("# vtk DataFile");
    if (isLegacy || head.find("<VTKFile") != std::string::npos) {
        const DeclaredSize size = isLegacy ? checkLegacyFile(path) : checkXmlFile(path, folder);
        const std::int64_t cells = size.fileBytes > kSmallFile ? size.cellsOfAll : 0;
        return {double(size.fileBytes), double(std::max(cells, size.gridPoints))};
    }
    if (extension == ".case" || extension == ".encas")
        return {double(checkEnSightCase(path, folder).bytes), 0};
    if (extension == ".node" || extension == ".ele")
        return {double(sizeOf(std::filesystem::path(given).replace_extension(".node")) +
                       sizeOf(std::filesystem::path(given).replace_extension(".ele"))),
                0};
    return {double(file.size()), 0};
}

IsolationLimits limitsFor(const InputSize& size, double floorBytes) {
    IsolationLimits limits;
    limits.memoryBytes = std::int64_t(
        std::min(floorBytes + std::max(kBytesPerFileByte * size.bytes, kBytesPerItem * size.items),
                 double(readingShare(defaultMemoryBytes()))));
    limits.processorSeconds =
        kFloorSeconds + std::max(kSecondsPerFileByte * size.bytes, kSecondsPerItem * size.items);
    limits.seconds = std::max(kFloorWaitSeconds, kWaitShare * limits.processorSeconds);
    return limits;
}

}  // namespace

std::int64_t readingShare(std::int64_t memoryBytes) {
    return std::max(memoryBytes - heldMemoryBytes() - kReaderBytes, memoryBytes / 4);
}

IsolationLimits limitsToLook() {
    return {std::int64_t(kFloorBytes), kFloorWaitSeconds, kLookSeconds};
}

IsolationLimits defaultLimits(const std::string& path, const ReadOptions& options) {
    const std::optional<std::string> folder = allowedFolder(path, options);
    checkParts(path, options);
    InputSize size = sizeOfInput(path, folder);
    for (const std::string& part : options.otherParts) {
        const InputSize more = sizeOfInput(part, folder);
        size.bytes += more.bytes;
        size.items += more.items;
    }
    return limitsFor(size, kFloorBytes);
}

IsolationLimits limitsOfVdb(const std::string& path) {
    return limitsFor({double(InputFile(path).size()), 0}, kVdbFloorBytes);
}

}  // namespace tessera
