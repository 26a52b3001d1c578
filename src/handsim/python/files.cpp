#include "handsim/output/atomic_file.h"
#include "handsim/output/output_folder.h"
#include "handsim/output/report/page.h"
#include "handsim/python/bindings.h"
#include "handsim/python/signals.h"

namespace handsim::python {

using Path = std::filesystem::path;
using Paths = std::vector<Path>;

/// Binds what python/handsim/_files.py writes files with.
void bind_files(py::module_& module) {
  module.attr("page_mark") = py::bytes(std::string(output::page_mark()));
  module.def("files_read", [](const SceneHandle& of) { return scene::files_read(*of.scene); });
  module.def("write_file", [](const Path& path, const std::string& content) {
    without_gil([&] { output::write_file(path, content); });
  });
  module.def("write_parts", [](const Path& path, const py::iterable& parts) {
    output::AtomicFile file(path);
    for (const py::handle part : parts) file.write(part.cast<std::string>());
    file.commit();
  });
  module.def("check_target", [](const std::string& option, const Path& path, const std::string& kind,
                                const std::string& mark, const Paths& inputs) {
    output::check_target(option, path, {kind, mark}, [&] { return inputs; });
  });
  module.def("output_folder", [](const Path& path, std::vector<std::string> names, const Paths& inputs) {
    return std::make_unique<output::OutputFolder>(path, std::move(names), [&] { return inputs; });
  });
  bind_class<output::OutputFolder>(module, "OutputFolder").def("clear", &output::OutputFolder::clear);
}

}  // namespace handsim::python
