// What this build of handsim is; CMake writes the file with the values at each build (cmake/version.cpp.in).
#pragma once

namespace handsim {

extern const char* const kVersion;   ///< e.g. `1.0.0`
extern const char* const kCommit;    ///< e.g. `28628a2-dirty`; `unknown` without a git checkout
extern const char* const kCompiler;  ///< e.g. `GNU 12.2.0, Release`
extern const char* const kOde;       ///< e.g. `ODE 0.16.2, double precision`

extern const char* const
    kInstalledData;  ///< the folder of handmodels/, config/ and controllers/ after an installation
extern const char* const kSourceData;  ///< the checkout from which this build was made

}  // namespace handsim
