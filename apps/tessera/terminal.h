#pragma once

namespace tessera {

/// Columns of the terminal behind a descriptor: what it says, else COLUMNS, else 80.
int terminalWidth(int descriptor);

/// Columns that text on standard output may take: those of the terminal, 80 where it is none.
int outputWidth();

}  // namespace tessera
