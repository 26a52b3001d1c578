// MuJoCo's objects as C++ has them: owned, compiled from text, complaining on standard error. Compiles with
// Debian's 2.2.2 and with PyPI's newest.
#pragma once

#include <mujoco/mujoco.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>

namespace mujoco {

struct Free {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};

/// @throws std::runtime_error with MuJoCo's message.
inline std::unique_ptr<mjModel, Free> compile(const std::string& xml) {
  // A virtual file: MuJoCo loads models by name.
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
#if mjVERSION_HEADER >= 320
  mj_addBufferVFS(files.get(), "model.xml", xml.data(), static_cast<int>(xml.size()));
#else
  const int slot = mj_makeEmptyFileVFS(files.get(), "model.xml", static_cast<int>(xml.size()) + 1);
  std::memcpy(files->filedata[slot], xml.c_str(), xml.size() + 1);
#endif
  char message[1000] = "";
  std::unique_ptr<mjModel, Free> model(mj_loadXML("model.xml", files.get(), message, sizeof message));
  mj_deleteVFS(files.get());
  if (!model) throw std::runtime_error(std::string("MuJoCo: ") + message);
  return model;
}

/// Without these MuJoCo writes its warnings to a file in the working directory.
inline void report_on_standard_error() {
  mju_user_error = [](const char* text) {
    std::fprintf(stderr, "MuJoCo: %s\n", text);
    std::exit(1);
  };
  mju_user_warning = [](const char* text) { std::fprintf(stderr, "MuJoCo: %s\n", text); };
}

}  // namespace mujoco
