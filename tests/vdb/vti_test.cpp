#include "base/floor_div.h"
#include "vdb/vti_write.h"

#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkFieldData.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkStringArray.h>
#include <vtkUnsignedCharArray.h>
#include <vtkXMLImageDataReader.h>

#include <atomic>

#include "refine/brick_result.h"
#include "tessera/error.h"
#include "vdb_case.h"

namespace tessera {
namespace {

class VtiTest : public VdbFileTest {
  protected:
    vtkImageData* read(const std::string& name) {
        reader_->SetFileName(file(name).c_str());
        reader_->Modified();
        reader_->Update();
        EXPECT_EQ(reader_->GetErrorCode(), 0u);
        return reader_->GetOutput();
    }

  private:
    vtkNew<vtkXMLImageDataReader> reader_;
};

Vec3i pointOf(vtkImageData* image, vtkIdType i, double spacing) {
    double place[3];
    image->GetPoint(i, place);
    return {int(std::lround(place[0] / spacing)), int(std::lround(place[1] / spacing)),
            int(std::lround(place[2] / spacing))};
}

/// What a tile of samples or of the extension holds at a point.
struct Expected {
    bool isStored = false, isCovered = false;
    std::vector<float> values;
};
Expected expectedAt(const BrickResult& result, const Vec3i& p) {
    Expected expected;
    const int cells = result.tree.brickCells();
    const std::int64_t leaf = result.tree.findLeaf({0, floorDiv(p, cells)});
    const int channels = result.store.channels();
    if (leaf >= 0) {
        const Vec3i local = p - floorDiv(p, cells) * cells;
        for (int c = 0; c < channels; ++c)
            expected.values.push_back(result.store.value(std::size_t(leaf), local, c, expected.isCovered));
    }
    expected.isStored = expected.isCovered;
    const Tile* tile = result.store.extensionAt(0, p);
    if (expected.isCovered || !tile) return expected;
    expected.isStored = true;
    expected.values.clear();
    for (int c = 0; c < channels; ++c) expected.values.push_back(tile->channel(c)[offsetInTile(p)]);
    return expected;
}

TEST_F(VtiTest, VtkReadsEveryPoint) {
    BrickResult result = flatResult(10);
    VdbWriteOptions options = flatOptions();
    options.hiddenValue = -3;
    options.time = 2.5;
    options.sourceFile = "mesh.vtu";
    const VdbWriteResult written = writeVti(file("out.vti"), kMixed, result, options, {});
    vtkImageData* image = read("out.vti");
    EXPECT_EQ(written.fileBytes, std::int64_t(fs::file_size(file("out.vti"))));
    EXPECT_EQ(image->GetSpacing()[1], kFlatSpacing);
    vtkPointData* data = image->GetPointData();
    vtkDataArray *t = data->GetArray("T"), *u = data->GetArray("U"), *s = data->GetArray("S"),
                 *mask = data->GetArray("vtkValidPointMask"), *ghosts = data->GetArray("vtkGhostType");
    ASSERT_TRUE(t && u && s && mask && ghosts);
    EXPECT_EQ(data->GetScalars(), t);
    EXPECT_EQ(t->GetDataType(), VTK_FLOAT);
    EXPECT_EQ(u->GetNumberOfComponents(), 3);
    EXPECT_EQ(s->GetNumberOfComponents(), 6);
    std::int64_t wrong = 0, stored = 0, extension = 0;
    for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i) {
        const Expected expected = expectedAt(result, pointOf(image, i, kFlatSpacing));
        wrong += mask->GetTuple1(i) != double(expected.isCovered);
        wrong += ghosts->GetTuple1(i) != (expected.isStored ? 0 : 2);
        stored += expected.isStored;
        extension += expected.isStored && !expected.isCovered;
        int channel = 0;
        for (vtkDataArray* array : {t, u, s})
            for (int c = 0; c < array->GetNumberOfComponents(); ++c, ++channel)
                wrong += !sameFloat(float(array->GetComponent(i, c)),
                                    expected.isStored ? expected.values[std::size_t(channel)] : -3.0f);
    }
    EXPECT_EQ(wrong, 0) << "of " << image->GetNumberOfPoints();
    EXPECT_EQ(written.activeVoxels, stored);
    EXPECT_EQ(extension, 2);
    EXPECT_LT(stored, image->GetNumberOfPoints());

    vtkFieldData* entries = image->GetFieldData();
    const auto text = [&](const char* name) {
        const auto* array = vtkStringArray::SafeDownCast(entries->GetAbstractArray(name));
        return array ? std::string(const_cast<vtkStringArray*>(array)->GetValue(0)) : "missing";
    };
    EXPECT_EQ(text("tessera_source"), "mesh.vtu");
    EXPECT_EQ(text("tessera_layout"), "flat");
    ASSERT_TRUE(entries->GetArray("TimeValue"));
    EXPECT_EQ(entries->GetArray("TimeValue")->GetTuple1(0), 2.5);
}

TEST_F(VtiTest, TheImageIsTheBoxOfTheVoxelsAndALayer) {
    BrickResult result = flatResult(
        1, valueAt, [](int, const Vec3i& p) { return p == Vec3i(-9, 3, 4) || p == Vec3i(2, -5, 4); });
    result.store.extension().clear();
    VdbWriteOptions options = flatOptions();
    options.unitScale = 1000;
    writeVti(file("out.vti"), kScalar, result, options, {});
    vtkImageData* image = read("out.vti");
    EXPECT_EQ(image->GetDimensions()[0], 12 + 2);
    EXPECT_EQ(image->GetDimensions()[1], 9 + 2);
    EXPECT_EQ(image->GetDimensions()[2], 1 + 2);
    EXPECT_EQ(image->GetOrigin()[0], -10 * kFlatSpacing * 1000);
    EXPECT_EQ(image->GetOrigin()[2], 3 * kFlatSpacing * 1000);
    EXPECT_EQ(image->GetSpacing()[2], kFlatSpacing * 1000);
    EXPECT_EQ(image->GetNumberOfCells(), 13 * 10 * 2);
    EXPECT_EQ(image->GetPointData()->GetArray("f")->GetTuple1(1 + 14 * (9 + 11)),
              double(valueAt(0, {-9, 3, 4}, 0)));
}

// Programs that take the range of all points see that of the field, zeros around it or not.
TEST_F(VtiTest, HiddenPointsDontChangeARange) {
    const ValueFunction value = [](int, const Vec3i& p, int channel) {
        return channel == 2 && p.x == 3 ? kNaN : float(700 + 3 * p.x - p.y + channel);
    };
    BrickResult result = flatResult(4, value);
    writeVti(file("out.vti"), {{"T", "T", "point", 1, 0}, {"U", "U", "point", 3, 1}}, result, flatOptions(),
             {});
    vtkPointData* data = read("out.vti")->GetPointData();
    vtkDataArray* ghosts = data->GetArray("vtkGhostType");
    std::int64_t hidden = 0;
    for (const char* name : {"T", "U"}) {
        vtkDataArray* array = data->GetArray(name);
        for (int c = -1; c < array->GetNumberOfComponents(); ++c) {  // -1: the length
            double low = HUGE_VAL, high = -HUGE_VAL;
            for (vtkIdType i = 0; i < array->GetNumberOfTuples(); ++i) {
                const double* tuple = array->GetTuple(i);
                double shown = c < 0 ? 0 : tuple[c];
                for (int k = 0; c < 0 && k < array->GetNumberOfComponents(); ++k)
                    shown += tuple[k] * tuple[k];
                if (c < 0) shown = std::sqrt(shown);
                hidden += ghosts->GetTuple1(i) != 0;
                if (ghosts->GetTuple1(i) != 0 || std::isnan(shown)) continue;
                low = std::min(low, shown);
                high = std::max(high, shown);
            }
            EXPECT_EQ(array->GetRange(c)[0], low) << name << c;
            EXPECT_EQ(array->GetRange(c)[1], high) << name << c;
        }
    }
    EXPECT_GT(hidden, 0);
}

// VTK tells cells beside a hidden point apart by flags that are written too.
TEST_F(VtiTest, CellsBesideHiddenPointsAreHidden) {
    BrickResult result = flatResult(1);
    writeVti(file("out.vti"), kScalar, result, flatOptions(), {});
    vtkImageData* image = read("out.vti");
    vtkDataArray* cells = image->GetCellData()->GetArray("vtkGhostType");
    ASSERT_TRUE(cells);
    std::int64_t hidden = 0, wrong = 0;
    vtkNew<vtkIdList> corners;
    for (vtkIdType c = 0; c < image->GetNumberOfCells(); ++c) {
        image->GetCellPoints(c, corners);
        bool isWhole = true;
        for (vtkIdType i = 0; i < corners->GetNumberOfIds(); ++i)
            isWhole =
                isWhole && image->GetPointData()->GetArray("vtkGhostType")->GetTuple1(corners->GetId(i)) == 0;
        wrong += cells->GetTuple1(c) != (isWhole ? 0 : 32) || bool(image->IsCellVisible(c)) != isWhole;
        hidden += !isWhole;
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_GT(hidden, 0);
    EXPECT_LT(hidden, image->GetNumberOfCells());
}

TEST_F(VtiTest, ValuesThatAreNotFiniteAreNaNInAllComponents) {
    BrickResult result = flatResult(
        3, [](int, const Vec3i& p, int channel) { return p.x == 1 && channel == 1 ? kInfinity : 4.0f; });
    writeVti(file("out.vti"), {{"U", "U", "point", 3, 0}}, result, flatOptions(), {});
    vtkImageData* image = read("out.vti");
    vtkDataArray *u = image->GetPointData()->GetArray("U"),
                 *mask = image->GetPointData()->GetArray("vtkValidPointMask");
    std::int64_t wrong = 0, notFinite = 0;
    for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i) {
        if (mask->GetTuple1(i) == 0) continue;
        const bool bad = pointOf(image, i, kFlatSpacing).x == 1;
        notFinite += bad;
        for (int c = 0; c < 3; ++c)
            wrong += bad ? !std::isnan(u->GetComponent(i, c)) : u->GetComponent(i, c) != 4;
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_GT(notFinite, 0);
}

TEST_F(VtiTest, AnyNameComesBackOrIsMarked) {
    BrickResult result = flatResult(2);
    const std::string odd = "a \"<&>\" \xc3\xa9 \xe6\xb0\xb4", broken = "b\x01\xe9";
    writeVti(file("out.vti"), {{odd, odd, "point", 1, 0}, {broken, broken, "point", 1, 1}}, result,
             flatOptions(), {});
    vtkPointData* data = read("out.vti")->GetPointData();
    EXPECT_TRUE(data->GetArray(odd.c_str()));
    EXPECT_TRUE(data->GetArray("b\xef\xbf\xbd\xef\xbf\xbd"));
}

TEST_F(VtiTest, SameBytesForAnyNumberOfThreads) {
    std::string first;
    for (const int threads : {1, 2, 5, 16}) {
        BrickResult result = flatResult(10);
        Execution execution;
        execution.threads = threads;
        writeVti(file("out.vti"), kMixed, result, flatOptions(), execution);
        const std::string bytes = readBytes(file("out.vti"));
        if (first.empty()) first = bytes;
        EXPECT_TRUE(bytes == first) << threads;
    }
}

TEST_F(VtiTest, WhatItCantHoldIsRefused) {
    BrickResult result = flatResult(1);
    VdbWriteOptions half = flatOptions(), turned = flatOptions();
    half.halfFloat = true;
    turned.upAxis = UpAxis::z;
    EXPECT_THROW(writeVti(file("out.vti"), kScalar, result, half, {}), InputError);
    EXPECT_THROW(writeVti(file("out.vti"), kScalar, result, turned, {}), InputError);
    for (const char* name : {"vtkGhostType", "vtkValidPointMask", "coverage"})
        EXPECT_THROW(writeVti(file("out.vti"), {{name, "f", "point", 1, 0}}, result, flatOptions(), {}),
                     InputError);
    BrickResult empty = flatResult(1, valueAt, [](int, const Vec3i&) { return false; });
    empty.store.extension().clear();
    EXPECT_THROW(writeVti(file("out.vti"), kScalar, empty, flatOptions(), {}), InputError);
    EXPECT_EQ(fileCount(), 0u);
}

// Two voxels far apart are a large image.
TEST_F(VtiTest, ABoxOfTooManyPointsIsRefused) {
    BrickResult result = flatResult(1);
    addExtension(result.store, 0, {1 << 20, 1 << 20, 1 << 20}, 1);
    VdbWriteOptions options = flatOptions();
    try {
        writeVti(file("out.vti"), kScalar, result, options, {});
        FAIL();
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("1048"), std::string::npos) << error.what();
        EXPECT_NE(std::string(error.what()).find("--max-voxels"), std::string::npos) << error.what();
    }
    EXPECT_EQ(fileCount(), 0u);
}

TEST_F(VtiTest, FailedAndCancelledWritesLeaveNothing) {
    for (const rlim_t limit : {rlim_t(0), rlim_t(1000), rlim_t(20000)}) {
        BrickResult result = flatResult(10);
        const FileSizeLimit full(limit);
        EXPECT_THROW(writeVti(file("out.vti"), kMixed, result, flatOptions(), {}), IoError) << limit;
        EXPECT_EQ(fileCount(), 0u);
    }
    const std::atomic<bool> cancel{true};
    Execution execution;
    execution.cancel = &cancel;
    BrickResult result = flatResult(1);
    EXPECT_THROW(writeVti(file("out.vti"), kScalar, result, flatOptions(), execution), Cancelled);
    EXPECT_EQ(fileCount(), 0u);
}

}  // namespace
}  // namespace tessera
