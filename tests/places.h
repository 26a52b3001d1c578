// The paths that tests need. They stand in a small file of each test program that CMake writes, so that the
// compiler's cache serves the same tests in a checkout elsewhere.
#pragma once

#include <string>

namespace handsim::test {

extern const char* const kSourceFolder;  ///< the checkout, without a slash at its end
extern const char* const
    kProgramFile;  ///< the program handsim that this test starts; empty if it starts none
extern const char* const kPythonProgram;  ///< that the package of this build is for; empty without it
extern const char* const kPackageFolder;  ///< in which Python finds the package

/// The path of a file of the checkout, e.g. `in_source("config/two_hands.yaml")`.
inline std::string in_source(const std::string& relative) {
  return std::string(kSourceFolder) + "/" + relative;
}

}  // namespace handsim::test
