#include "commands.h"
namespace tessera {
void addPictureOptions(CLI::App& , PictureArguments& ) {}
int runPicture(const PictureArguments& ) { return 0; }
}
