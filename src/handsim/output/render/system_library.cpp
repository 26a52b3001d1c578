#include "handsim/output/render/system_library.h"

#include <dlfcn.h>

namespace handsim::output {

SystemLibrary::SystemLibrary(const char* file) : handle_(dlopen(file, RTLD_LAZY | RTLD_LOCAL)) {}

void* SystemLibrary::address(const char* name) const { return handle_ ? dlsym(handle_, name) : nullptr; }

}  // namespace handsim::output
