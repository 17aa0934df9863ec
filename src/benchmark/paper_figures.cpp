#include "benchmark/paper_figures.h"

namespace tessera {

namespace {

PaperRow device(std::string_view name, std::string_view algorithm, double ael, double rnd, double tot,
                int polygonsK) {
    return {name, algorithm, ael, rnd, tot, polygonsK};
}
PaperRow software(double seconds) {
    return {"Software", "software", {}, {}, seconds, {}};
}

std::vector<PaperGrid> bluntfinGrids() {
    return {
        {{128, 64, 32},
         {device("MultiComb", "slicing", 0.30, 0.39, 0.69, 239),
          device("Hybrid", "hybrid", 0.10, 0.37, 0.41, 319), device("WestSingle", "", 0.49, 0.67, 1.16, 1392),
          device("WestM/C", "", 0.49, 0.54, 1.03, 696), software(0.80)}},
        {{256, 128, 64},
         {device("MultiComb", "slicing", 0.30, 0.82, 1.12, 457),
          device("Hybrid", "hybrid", 0.10, 0.74, 0.84, 457), device("WestSingle", "", 0.49, 1.28, 1.77, 2654),
          device("WestM/C", "", 0.49, 1.03, 1.52, 1327), software(1.23)}},
        {{512, 256, 128},
         {device("MultiComb", "slicing", 0.29, 3.28, 3.57, 921),
          device("Hybrid", "hybrid", 0.11, 1.56, 1.67, 921), device("WestSingle", "", 0.49, 2.68, 3.17, 5440),
          device("WestM/C", "", 0.49, 2.08, 2.57, 2720), software(3.01)}},
        {{1024, 512, 256}, {software(12.13)}}};
}

std::vector<PaperGrid> doubleGrids() {
    return {
        {{128, 64, 32},
         {device("MultiComb", "slicing", 0.61, 0.82, 1.43, 450),
          device("Hybrid", "hybrid", 0.21, 0.75, 0.96, 600), device("WestSingle", "", 0.93, 1.37, 2.37, 2786),
          device("WestM/C", "", 0.93, 1.03, 1.96, 1393), software(1.50)}},
        {{256, 128, 64},
         {device("MultiComb", "slicing", 0.61, 0.87, 1.48, 457),
          device("Hybrid", "hybrid", 0.21, 0.84, 1.05, 609), device("WestSingle", "", 0.93, 2.66, 3.59, 5484),
          device("WestM/C", "", 0.93, 1.99, 2.92, 2742), software(1.96)}},
        {{512, 256, 128},
         {device("MultiComb", "slicing", 0.61, 3.99, 4.60, 1842),
          device("Hybrid", "hybrid", 0.22, 3.29, 3.51, 2456),
          device("WestSingle", "", 0.94, 5.33, 6.27, 10968), device("WestM/C", "", 0.94, 3.98, 4.92, 5484),
          software(4.08)}},
        {{128, 128, 32}, {software(1.66)}},
        {{256, 256, 64}, {software(2.54)}},
        {{512, 512, 128}, {software(6.07)}}};
}

std::vector<PaperGrid> quadGrids() {
    return {{{128, 64, 32}, {software(2.79)}},   {{256, 128, 64}, {software(3.52)}},
            {{512, 256, 128}, {software(6.07)}}, {{128, 128, 64}, {software(3.17)}},
            {{256, 256, 128}, {software(5.09)}}, {{512, 512, 256}, {software(12.11)}}};
}

}  // namespace

std::span<const PaperDataSet> paperDataSets() {
    static const std::vector<PaperDataSet> sets{{"", "figures 9 and 11", 220, {}, bluntfinGrids()},
                                                {"double ", "figures 10 and 11", 450, {1}, doubleGrids()},
                                                {"quad ", "figure 11", 900, {1, 2}, quadGrids()}};
    return sets;
}

}  // namespace tessera
