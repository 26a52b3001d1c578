// Libraries of the system that are loaded when the first picture is drawn. OpenGL's libraries take 20 ms to
// load, and a system may lack them: a program that draws nothing needs neither the time nor the libraries.
#pragma once

namespace handsim::output {

/// A shared library of the system, e.g. `libEGL.so.1`. It stays loaded until the process ends.
class SystemLibrary {
 public:
  explicit SystemLibrary(const char* file);

  bool found() const { return handle_ != nullptr; }

  /// The function of this name; null where the library or the function is missing.
  template <class Function>
  Function function(const char* name) const {
    return reinterpret_cast<Function>(address(name));
  }

 private:
  void* address(const char* name) const;

  void* handle_;
};

/// Declares a member of the type and name of a function that a header of the library declares. The class has
/// a member `library` before it, of type SystemLibrary.
#define HANDSIM_SYSTEM_FUNCTION(NAME) decltype(&::NAME) NAME = library.function<decltype(&::NAME)>(#NAME)

}  // namespace handsim::output
