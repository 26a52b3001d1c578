// The linker's option `--wrap` puts any_engine in the place of engine::make_engine, under its name as GCC and
// clang write it.
#include "peers/other_engine.h"

namespace handsim::peers {

namespace {

MakeEngine& chosen() {
  static MakeEngine make;
  return make;
}

}  // namespace

void use_engine(MakeEngine make) { chosen() = std::move(make); }

std::unique_ptr<engine::Engine> own_engine(const model::Model& model, const engine::Settings& settings) asm(
    "__real__ZN7handsim6engine11make_engineERKNS_5model5ModelERKNS0_8SettingsE");
std::unique_ptr<engine::Engine> any_engine(const model::Model& model, const engine::Settings& settings) asm(
    "__wrap__ZN7handsim6engine11make_engineERKNS_5model5ModelERKNS0_8SettingsE");
std::unique_ptr<engine::Engine> any_engine(const model::Model& model, const engine::Settings& settings) {
  return chosen() ? chosen()(model, settings) : own_engine(model, settings);
}

}  // namespace handsim::peers
