#include "peers/peer_program.h"

#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "handsim/model/energy.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/report/page.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

using model::Effect;

/// Largest difference between a peer's start and the scene's [m], [rad], [m/s], [rad/s].
constexpr double kSameStart = 1e-9;
constexpr double kSameEnergy = 1e-9;  ///< the same for kinetic energy, relative

Error failed(const std::filesystem::path& program, double time, std::string quantity, std::string detail) {
  return Error(PhysicsFault{time, program.filename().string(), std::move(quantity), std::move(detail)});
}

Json numbers(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

/// In the order of model::JointKind.
constexpr std::array kJointKinds = {"hinge", "universal", "ball", "slider"};

Json describe(const model::Body& body, const model::BodyState& state) {
  Json inertia = Json::array();
  for (int i = 0; i < 9; ++i) inertia.push_back(body.inertia(i / 3, i % 3));
  return {{"name", body.name},
          {"mass", body.mass},
          {"inertia", inertia},
          {"position", numbers(state.p)},
          {"orientation", {state.q.w(), state.q.x(), state.q.y(), state.q.z()}},
          {"velocity", numbers(state.v)},
          {"angular_velocity", numbers(state.w)}};
}

Json describe(const model::Joint& joint, const model::Model& model, const model::State& start,
              bool actuated) {
  const auto body = [&](int index) { return static_cast<std::size_t>(index); };
  const Pose parent = start.bodies[body(joint.parent)].pose() * joint.parent_frame;
  const Pose child = start.bodies[body(joint.child)].pose() * joint.child_frame;
  Json axes = Json::array(), forces = Json::array();
  for (std::size_t a = 0; a < joint.axes.size(); ++a) {
    axes.push_back(numbers((a == 0 ? parent : child).q * joint.axes[a].axis));
    forces.push_back(actuated ? joint.axes[a].torque : 0.0);
  }
  return {{"name", joint.name},
          {"kind", kJointKinds[static_cast<std::size_t>(joint.kind)]},
          {"parent", model.bodies[body(joint.parent)].name},
          {"child", model.bodies[body(joint.child)].name},
          {"closes_loop", joint.closes_loop},
          {"anchor", numbers(parent.p)},
          {"axes", axes},
          {"forces", forces}};
}

Json request(const char* task, const PeerMethod& method, const scene::Scene& scene, long steps) {
  const model::Model& model = scene.model;
  const model::State start = model::initial_state(model);
  const model::Effects& effects = scene.spec.solver.effects;
  Json out = {{"task", task}, {"method", method.method}, {"step", scene.spec.solver.step}, {"steps", steps}};
  out["settings"] = Json::object();
  for (const auto& [key, value] : method.settings) out["settings"][key] = value;
  out["gravity"] = numbers(effects.has(Effect::gravity) ? model.gravity : Vec3(Vec3::Zero()));
  out["bodies"] = Json::array();
  for (std::size_t i = 1; i < model.bodies.size(); ++i)
    out["bodies"].push_back(describe(model.bodies[i], start.bodies[i]));
  out["joints"] = Json::array();
  for (const model::Joint& joint : model.joints)
    out["joints"].push_back(describe(joint, model, start, effects.has(Effect::actuation)));
  return out;
}

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

/// A running program that got a request; its answer is read line by line. Its own end comes at the latest
/// when it writes after this object's.
class PeerProcess {
 public:
  PeerProcess(std::filesystem::path program, const std::string& request)
      : program_(std::move(program)), in_(std::tmpfile(), std::fclose), errors_(std::tmpfile(), std::fclose) {
    if (in_ && errors_) {
      std::fwrite(request.data(), 1, request.size(), in_.get());
      std::fflush(in_.get());
      out_.reset(popen(fmt::format("exec {} </dev/fd/{} 2>/dev/fd/{}", output::shell_word(program_.string()),
                                   fileno(in_.get()), fileno(errors_.get()))
                           .c_str(),
                       "r"));
    }
    if (!out_) throw failed(program_, 0, "start", "no process or temporary file");
  }
  PeerProcess(const PeerProcess&) = delete;
  PeerProcess& operator=(const PeerProcess&) = delete;
  ~PeerProcess() { std::free(line_); }

  /// The next line, without its end.
  std::optional<std::string_view> line() {
    const ssize_t length = getline(&line_, &capacity_, out_.get());
    if (length <= 0) return std::nullopt;
    return std::string_view(line_, static_cast<std::size_t>(length - (line_[length - 1] == '\n' ? 1 : 0)));
  }

  /// Waits for the end of the program. @throws Error (physics) unless its status is 0.
  void finish(double time) {
    const int status = pclose(out_.release());
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
    throw failed(program_, time, "failed",
                 WIFEXITED(status) ? last_message() : fmt::format("killed by signal {}", WTERMSIG(status)));
  }

  const std::filesystem::path& program() const { return program_; }

 private:
  /// The last line of standard error that is not blank.
  std::string last_message() {
    std::rewind(errors_.get());
    std::string last = "no message";
    char text[500];
    while (std::fgets(text, sizeof text, errors_.get())) {
      const std::string line(text, std::strcspn(text, "\n"));
      if (line.find_first_not_of(" \t\r") != std::string::npos) last = line;
    }
    return last;
  }

  std::filesystem::path program_;
  File in_, errors_, out_{nullptr, pclose};
  char* line_ = nullptr;
  std::size_t capacity_ = 0;
};

/// Reads the first line of the answer.
Json head(PeerProcess& peer) {
  const std::optional<std::string_view> line = peer.line();
  if (!line) {
    peer.finish(0);
    throw failed(peer.program(), 0, "answer", "none");
  }
  Json json = Json::parse(*line, nullptr, false);
  if (json.is_object() && json.contains("engine") && json.contains("version") &&
      json.contains("kinetic_energy"))
    return json;
  throw failed(peer.program(), 0, "answer",
               fmt::format("'{:.60}' is not the first line of the protocol", *line));
}

/// @returns false unless the line has exactly the numbers of a state, all finite.
bool parse(std::string_view line, model::State& state) {
  std::vector<double> numbers;
  const char* at = line.data();
  const char* const end = at + line.size();
  while (at < end) {
    if (*at == ' ') {
      ++at;
      continue;
    }
    const std::from_chars_result result = std::from_chars(at, end, numbers.emplace_back());
    if (result.ec != std::errc() || !std::isfinite(numbers.back())) return false;
    at = result.ptr;
  }
  constexpr std::size_t kPerBody = 13;
  if (numbers.size() != 1 + kPerBody * (state.bodies.size() - 1)) return false;
  state.time = numbers.front();
  const double* n = &numbers[1];
  for (std::size_t i = 1; i < state.bodies.size(); ++i, n += kPerBody)
    state.bodies[i] = {
        {n[0], n[1], n[2]}, Quat(n[3], n[4], n[5], n[6]), {n[7], n[8], n[9]}, {n[10], n[11], n[12]}};
  return true;
}

/// Largest difference of two states in SI units [m], [rad], [m/s], [rad/s].
double distance(const model::State& a, const model::State& b) {
  double largest = 0;
  for (std::size_t i = 1; i < a.bodies.size(); ++i) {
    const model::BodyState &x = a.bodies[i], &y = b.bodies[i];
    largest = std::max(
        {largest, (x.p - y.p).norm(), x.q.angularDistance(y.q), (x.v - y.v).norm(), (x.w - y.w).norm()});
  }
  return largest;
}

void check_start(const std::filesystem::path& program, const scene::Scene& scene, const model::State& theirs,
                 double their_energy) {
  const model::State ours = model::initial_state(scene.model);
  if (const double d = distance(theirs, ours); !(d <= kSameStart))
    throw failed(program, 0, "start state", fmt::format("differs from the scene's by {:.2g}", d));
  const double energy = model::kinetic_energy(scene.model, ours);
  if (!(std::abs(their_energy - energy) <= kSameEnergy * (energy + 1e-3)))
    throw failed(
        program, 0, "kinetic energy at the start",
        fmt::format("{:.12g} J, the scene's is {:.12g} J: the mechanisms differ", their_energy, energy));
}

void check_for_peers(const scene::Scene& scene) {
  const model::Effects& effects = scene.spec.solver.effects;
  std::vector<Problem> problems;
  for (const Effect effect : {Effect::object_contact, Effect::self_contact, Effect::ground_contact,
                              Effect::joint_stops, Effect::passive_tissue, Effect::wrist_motion})
    if (effects.has(effect))
      problems.push_back({std::nullopt, "effects", std::string(name(effect)),
                          "only gravity and actuation in a study with other engines"});
  if (scene.control)
    problems.push_back({std::nullopt, "control", "a controller", "none in a study with other engines"});
  for (std::size_t i = 1; i < scene.model.bodies.size(); ++i)
    if (scene.model.bodies[i].kinematic)
      problems.push_back({std::nullopt, "peers", scene.model.bodies[i].name + ", a kinematic body",
                          "a scene without kinematic bodies"});
  if (!problems.empty()) throw Error(std::move(problems));
}

/// @return name and version of the engine that answered.
std::string simulate(const std::filesystem::path& program, const PeerMethod& method,
                     const scene::Scene& scene, const std::function<void(const model::State&)>& update) {
  check_for_peers(scene);
  const double h = scene.spec.solver.step;
  const long steps = std::lround(scene.spec.duration / h);
  PeerProcess peer(program, request("motion", method, scene, steps).dump());
  const Json answer = head(peer);
  model::State state = model::initial_state(scene.model);
  for (long i = 0; i <= steps; ++i) {
    const double time = static_cast<double>(i) * h;
    const std::optional<std::string_view> line = peer.line();
    if (!line) {
      peer.finish(time);
      throw failed(program, time, "answer", "ends before the end of the run");
    }
    if (!parse(*line, state)) throw failed(program, time, "state", fmt::format("'{:.60}'", *line));
    if (!(std::abs(state.time - time) <= 1e-6 * h))
      throw failed(program, time, "time", fmt::format("the state has the time {:.12g} s", state.time));
    if (i == 0) check_start(program, scene, state, answer["kinetic_energy"].get<double>());
    model::update_coordinates(scene.model, state);
    update(state);
  }
  peer.finish(scene.spec.duration);
  return answer["engine"].get<std::string>() + " " + answer["version"].get<std::string>();
}

double cpu_seconds(const std::filesystem::path& program, const PeerMethod& method, const scene::Scene& scene,
                   long steps) {
  PeerProcess peer(program, request("cost", method, scene, steps).dump());
  const Json answer = head(peer);
  peer.finish(0);
  if (!answer.contains("cpu_seconds")) throw failed(program, 0, "answer", "has no cpu_seconds");
  return answer["cpu_seconds"].get<double>();
}

}  // namespace

OutsideEngine outside_engine(const std::filesystem::path& folder, const PeerMethod& method) {
  const std::filesystem::path program = folder / method.program;
  return {[=](const scene::Scene& scene, const std::function<void(const model::State&)>& update) {
            return simulate(program, method, scene, update);
          },
          [=](const scene::Scene& scene, long steps) { return cpu_seconds(program, method, scene, steps); }};
}

}  // namespace handsim::study
