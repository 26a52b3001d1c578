#include "handsim/simulation/run/output_size.h"

#include <sys/resource.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/engine/engine.h"
#include "handsim/simulation/run/run_tables.h"

namespace handsim::simulation {

namespace {

constexpr double kNumberBytes = 19;  ///< With its separator. Shipped scenes: 17.7 to 20.6.
/// A row of contacts.csv, and contacts that a hand or an object has. Shipped grasps: 230 bytes, 12 of a hand.
constexpr double kContactBytes = 230, kHandContacts = 12, kObjectContacts = 4;
/// Bytes of a PNG per pixel. Shipped scenes: 0.12 to 0.41.
constexpr double kPixelBytes = 0.4;
constexpr double kMuch = 1e9;
constexpr double kMostMoments = 1e9;

std::string size_text(double bytes) {
  return bytes >= 1e12  ? fmt::format("{:.3g} TB", bytes / 1e12)
         : bytes >= 1e9 ? fmt::format("{:.3g} GB", bytes / 1e9)
         : bytes >= 1e6 ? fmt::format("{:.3g} MB", bytes / 1e6)
                        : fmt::format("{:.3g} kB", bytes / 1e3);
}

double contacts_of(const scene::Scene& scene) {
  return kHandContacts * static_cast<double>(scene.plans.hands.size()) +
         kObjectContacts * static_cast<double>(scene.plans.objects.size());
}

/// Free where a path is or will be; nothing where the system does not report it.
std::optional<double> free_bytes(const std::filesystem::path& path) {
  std::error_code failure;
  std::filesystem::path at = std::filesystem::absolute(path, failure);
  while (!std::filesystem::exists(at, failure) && at.has_relative_path()) at = at.parent_path();
  struct statvfs room {};
  // Some file systems that are no disks report 0 blocks.
  if (::statvfs(at.c_str(), &room) != 0 || room.f_blocks == 0) return std::nullopt;
  return static_cast<double>(room.f_bavail) * static_cast<double>(room.f_frsize);
}

double largest_file() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_FSIZE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
    return std::numeric_limits<double>::infinity();
  return static_cast<double>(limit.rlim_cur);
}

/// The time between rows, rounded up to two digits, with which so many bytes a row fit into a room.
std::string fitting_every(const scene::SceneSpec& spec, const OutputSize& size, double row, double room) {
  const double span =
      static_cast<double>(size.rows) * static_cast<double>(record_steps(spec)) * spec.solver.step;
  const double every = span * row / room;
  if (!(room > 0) || !(every < spec.duration)) return "more room, or a shorter duration";
  const double digit = std::pow(10, std::floor(std::log10(every)) - 1);
  return fmt::format("{:.2g} s or more, or a shorter duration", digit * std::ceil(every / digit));
}

}  // namespace

long record_rows(long first, long last, long every) {
  return last / every - (first > 0 ? (first - 1) / every : -1);
}

long record_steps(const scene::SceneSpec& spec) {
  return std::max(1L, std::lround(spec.record_every / spec.solver.step));
}

OutputSize output_size(const scene::Scene& scene, long first, long last, int frames) {
  OutputSize out;
  const double bodies = static_cast<double>(scene.model.bodies.size()), dofs = scene.model.dof_count();
  const double axes = scene.control ? static_cast<double>(scene.control->axes.size()) : 0;
  const double trajectory = kNumberBytes * (1 + 2 * dofs + 7 * (bodies - 1));
  const double contacts = scene.spec.record_contacts ? kContactBytes * contacts_of(scene) : 0;
  out.rows = record_rows(first, last, record_steps(scene.spec));
  constexpr double kMuscleBytes = 17;  // of a number: many are 0
  const double muscles =
      kMuscleBytes * static_cast<double>(kMuscleColumns.size() * scene.model.muscles.size());
  out.largest_row = std::max({trajectory, contacts, muscles});
  out.row = trajectory + contacts + muscles + kNumberBytes * (dofs + 3 * axes) +
            extra_row_bytes(scene, kNumberBytes);
  const auto [width, height] = scene.spec.pictures.size;
  out.pictures = kPixelBytes * frames * width * height;
  for (const scene::ReferencedFile& input : scene.inputs)
    out.inputs += static_cast<double>(input.bytes->size());
  out.moments = frames * (bodies * sizeof(model::BodyState) + contacts_of(scene) * sizeof(engine::Contact));
  return out;
}

std::optional<std::string> check_room(const scene::Scene& scene, const OutputSize& size,
                                      const std::filesystem::path& out) {
  const double rows = static_cast<double>(size.rows);
  if (size.moments > kMostMoments)
    throw input_error("--frames", fmt::format("pictures of moments that take {}", size_text(size.moments)),
                      fmt::format("at most {}: fewer pictures", size_text(kMostMoments)));
  if (const double most = largest_file(); rows * size.largest_row > most)
    throw input_error("record.every",
                      fmt::format("a table of about {}, where the system allows files of {}",
                                  size_text(rows * size.largest_row), size_text(most)),
                      fitting_every(scene.spec, size, size.largest_row, most));
  const std::optional<double> free = free_bytes(out);
  if (free && size.pictures > *free)
    throw input_error("--frames",
                      fmt::format("pictures of about {} to write to {}, where {} are free",
                                  size_text(size.pictures), out.string(), size_text(*free)),
                      "fewer or smaller pictures");
  if (free && size.total() > *free)
    throw input_error("record.every",
                      fmt::format("about {} to write to {}, where {} are free", size_text(size.total()),
                                  out.string(), size_text(*free)),
                      fitting_every(scene.spec, size, size.row, *free - size.pictures - size.inputs));
  if (size.total() < kMuch) return std::nullopt;
  return fmt::format("about {} will be written to {} ({} rows); a larger record.every writes less",
                     size_text(size.total()), out.string(), size.rows);
}

void check_free(double bytes, const std::filesystem::path& out, const std::string& remedy) {
  if (const std::optional<double> free = free_bytes(out); free && bytes > *free)
    throw input_error("--out",
                      fmt::format("about {} to write to {}, where {} are free", size_text(bytes),
                                  out.string(), size_text(*free)),
                      remedy + ", or more room");
}

}  // namespace handsim::simulation
