#include <algorithm>

#include "handsim/output/render/contact_sheet.h"
#include "handsim/output/render/image.h"
#include "handsim/output/video/video.h"
#include "handsim/python/bindings.h"
#include "handsim/python/frame.h"
#include "handsim/python/signals.h"
#include "handsim/simulation/simulation.h"

namespace handsim::python {

namespace {

using VideoPixels = py::array_t<std::uint8_t, py::array::c_style>;

py::array_t<std::uint8_t> image_array(const output::Image& image) {
  py::array_t<std::uint8_t> out({image.height, image.width, 3});
  std::ranges::copy(image.rgb, out.mutable_data());
  return out;
}

Vec3 vector_of(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

scene::PictureSpec chosen(scene::PictureSpec spec, const PictureChoice& choice) {
  if (choice.size) spec.size = *choice.size;
  if (choice.view) {
    const std::array<std::string_view, 4> names = {"dorsal", "palmar", "radial", "three_quarter"};
    const auto found = std::ranges::find(names, *choice.view);
    if (found == names.end())
      throw input_error("view", *choice.view, "dorsal, palmar, radial or three_quarter");
    spec.view = static_cast<scene::View>(found - names.begin());
    spec.camera.reset();
  }
  if (choice.camera) {
    const auto& [position, target, angle] = *choice.camera;
    spec.camera = scene::CameraSpec{vector_of(position), vector_of(target), angle};
  }
  return spec;
}

/// The scene at a time [s], with contacts.
Frame frame_at(const SceneHandle& of, double time) {
  if (!(time >= 0 && time <= of.scene->spec.duration))
    throw input_error("time", std::to_string(time),
                      "0 to the scene's duration of " + std::to_string(of.scene->spec.duration) + " s");
  Signals signals;
  return without_gil([&] {
    simulation::Simulation simulation(of.scene, simulation::only<simulation::Monitor>);
    const long steps = std::lround(time / of.scene->spec.solver.step);
    for (long i = 0; i < steps; ++i) {
      simulation.step();
      signals.poll(0);
    }
    return Frame{simulation::picture_state(simulation.engine())};
  });
}

py::list draw_frames(const SceneHandle& of, const std::vector<Frame>& frames,
                     std::optional<std::array<int, 2>> size, std::optional<std::string> view,
                     decltype(PictureChoice::camera) camera) {
  std::vector<simulation::PictureState> moments;
  for (const Frame& frame : frames) {
    if (frame.moment.state.bodies.size() != of.scene->model.bodies.size())
      throw input_error("frames", std::to_string(frame.moment.state.bodies.size()) + " bodies",
                        std::to_string(of.scene->model.bodies.size()) + ", of this scene");
    moments.push_back(frame.moment);
  }
  return draw_all(*of.scene, std::move(moments), {size, std::move(view), camera});
}

/// A video of the scene from its start to a time [s].
void film(const SceneHandle& of, const VideoChoice& video, double time,
          std::optional<std::array<int, 2>> size, std::optional<std::string> view,
          decltype(PictureChoice::camera) camera, const py::object& progress) {
  const scene::PictureSpec pictures = chosen(of.scene->spec.pictures, {size, std::move(view), camera});
  Signals signals(progress);
  // Half of the share is the simulation's.
  const auto poll = [&signals](double begin) {
    return [&signals, begin](double share) { signals.poll(begin + share / 2); };
  };
  without_gil([&] {
    const simulation::Film film = simulation::film_until(*of.scene, video_of(video), time, poll(0));
    film.write(pictures, {}, poll(0.5));
  });
}

using Pixels = py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast>;

/// Pictures of one size on a page.
py::array_t<std::uint8_t> sheet(const std::vector<Pixels>& pictures, const std::vector<std::string>& captions,
                                const std::string& title, int width) {
  if (pictures.empty() || captions.size() != pictures.size())
    throw input_error("captions", std::to_string(captions.size()),
                      "one for each of " + std::to_string(pictures.size()) + " pictures, at least one");
  const output::Image first = image_of(pictures[0]);
  output::ContactSheet page({static_cast<int>(pictures.size()), first.width, first.height, title, width});
  for (std::size_t i = 0; i < pictures.size(); ++i) page.add(image_of(pictures[i]), captions[i]);
  return image_array(page.image());
}

}  // namespace

py::list draw_all(const scene::Scene& scene, std::vector<simulation::PictureState> moments,
                  const PictureChoice& choice) {
  const scene::PictureSpec pictures = chosen(scene.spec.pictures, choice);
  std::vector<output::Image> images;
  Signals signals;
  without_gil([&] {
    simulation::draw(
        {scene.model, pictures}, moments, {}, [](std::size_t, const output::Image&) {},
        [&](std::size_t, const simulation::Picture& picture) {
          images.push_back(picture.image);
          signals.poll(0);
        });
  });
  py::list out;
  for (const output::Image& image : images) out.append(image_array(image));
  return out;
}

void bind_pictures(py::module_& module) {
  bind_class<Frame>(module, "Frame").def_property_readonly("time", [](const Frame& of) {
    return of.moment.state.time;
  });
  module.def("frame_at", &frame_at);
  module.def("draw", &draw_frames);
  module.def("film", &film);
  module.def("contact_sheet", &sheet);
  module.def("video", [](const std::filesystem::path& file, int width, int height, double fps) {
    return std::make_unique<output::VideoWriter>(output::VideoFormat{file, width, height, fps});
  });
  // A video of arrays of pixels, which all have one size.
  bind_class<output::VideoWriter>(module, "Video")
      .def("add",
           [](output::VideoWriter& self, const VideoPixels& pixels) {
             const output::Image image = image_of(pixels);
             without_gil([&] { self.add(image); });
           })
      .def("finish", [](output::VideoWriter& self) { without_gil([&] { self.finish(); }); });
}

}  // namespace handsim::python
