#include "handsim/app/report_command.h"
#include "handsim/output/report/page.h"
#include "handsim/output/video/video.h"
#include "handsim/python/bindings.h"
#include "handsim/python/signals.h"

namespace handsim::python {

namespace {

/// The page of a run or study, or of two runs; its path.
std::filesystem::path report(const std::vector<std::filesystem::path>& folders,
                             const std::optional<std::filesystem::path>& out) {
  return without_gil([&] { return app::write_report(folders, out); });
}

using VideoPixels = py::array_t<std::uint8_t, py::array::c_style>;

/// A video of arrays of pixels, one size for all.
class Video {
 public:
  Video(const std::filesystem::path& file, int width, int height, double fps)
      : writer_({file, width, height, fps}) {}

  void add(const VideoPixels& pixels) {
    const output::Image image = image_of(pixels);
    without_gil([&] {
      writer_.add(image);
      return 0;
    });
  }
  void finish() {
    without_gil([&] {
      writer_.finish();
      return 0;
    });
  }

 private:
  output::VideoWriter writer_;
};

}  // namespace

void bind_reports(py::module_& module) {
  module.attr("has_reports") = output::has_three();
  module.def("report", &report, py::arg("folders"), py::arg("out"));
  module.def(
      "video",
      [](const std::filesystem::path& file, int width, int height, double fps) {
        return std::make_unique<Video>(file, width, height, fps);
      },
      py::arg("file"), py::arg("width"), py::arg("height"), py::arg("fps"));
  bind_class<Video>(module, "Video")
      .def("add", &Video::add, py::arg("picture"))
      .def("finish", &Video::finish);
}

}  // namespace handsim::python
