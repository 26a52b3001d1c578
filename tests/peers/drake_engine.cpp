#include "peers/drake_engine.h"
#include "support/written.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <ctime>
#include <mutex>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "handsim/engine/checks.h"

namespace handsim::peers {

namespace {

using Json = nlohmann::json;

constexpr std::size_t kBodyNumbers = 13, kContactNumbers = 9;
/// Of a contact point [N/m]: SAP takes what is stiffer than its near-rigid threshold as rigid.
constexpr double kPointStiffness = 1e7;
/// Speed below which friction is less than the limit [m/s].
constexpr double kStiction = 1e-6;

/// A program with a pipe to its standard input and one from its standard output.
class Child {
 public:
  explicit Child(const char* script) {
    int to[2], from[2];
    if (pipe2(to, O_CLOEXEC) != 0 || pipe2(from, O_CLOEXEC) != 0)
      throw input_error("drake", "no pipe", "one");
    id_ = vfork();
    if (id_ == 0) {
      dup2(to[0], 0);
      dup2(from[1], 1);
      execlp("python3", "python3", script, nullptr);
      _exit(127);
    }
    close(to[0]);
    close(from[1]);
    to_ = to[1], from_ = from[0];
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() {
    close(to_);
    close(from_);
    waitpid(id_, nullptr, 0);
  }
  bool send(const void* data, std::size_t size) {
    return all(size, data, [&](auto* at, auto n) { return write(to_, at, n); });
  }
  bool receive(void* data, std::size_t size) {
    return all(size, data, [&](auto* at, auto n) { return ::read(from_, at, n); });
  }
  /// CPU time so far [s].
  double cpu() const {
    clockid_t clock{};
    timespec now{};
    if (clock_getcpuclockid(id_, &clock) != 0 || clock_gettime(clock, &now) != 0) return 0;
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }

 private:
  template <class Data, class Move>
  static bool all(std::size_t size, Data* data, Move move) {
    auto* at = static_cast<std::conditional_t<std::is_const_v<Data>, const char*, char*>>(data);
    while (size > 0) {
      const ssize_t moved = move(at, size);
      if (moved <= 0) return false;
      at += moved, size -= static_cast<std::size_t>(moved);
    }
    return true;
  }
  pid_t id_ = 0;
  int to_ = 0, from_ = 0;
};

/// Idle children, as Drake's modules take a second to load.
class Children {
 public:
  std::unique_ptr<Child> take(const char* script) {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) return std::make_unique<Child>(script);
    std::unique_ptr<Child> out = std::move(idle_.back());
    idle_.pop_back();
    return out;
  }
  void give_back(std::unique_ptr<Child> child) {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(child));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<Child>> idle_;
};

Children& children() {
  static Children all;
  return all;
}

bool jointed(const model::Model& model, int a, int b) {
  for (const model::Joint& joint : model.joints)
    if ((joint.parent == a && joint.child == b) || (joint.parent == b && joint.child == a)) return true;
  return false;
}

/// @throws Error (physics) where the limit is reached.
void require_time(const DrakeOptions& options, double time) {
  if (options.limit && options.limit->spent >= options.limit->seconds)
    throw Error(PhysicsFault{time, "drake", kTooSlow, fmt::format("at most {:g}", options.limit->seconds)});
}

/// Shapes that may touch.
Json pairs_of(const model::Model& model, const engine::Settings& settings) {
  Json out = Json::array();
  if (!engine::needs_contacts(model, settings.effects)) return out;
  const std::vector<bool> still = engine::immovable_bodies(model, settings.effects);
  for (std::size_t i = 0; i < model.shapes.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) {
      const model::Shape &a = model.shapes[i], &b = model.shapes[k];
      const auto fixed = [&](const model::Shape& shape) {
        return still[static_cast<std::size_t>(shape.body)];
      };
      if (a.body == b.body || (fixed(a) && fixed(b)) || (a.body && b.body && jointed(model, a.body, b.body)))
        continue;
      for (const model::ContactRule& rule : model.contact_rules)
        if ((rule.group_a == a.group && rule.group_b == b.group) ||
            (rule.group_a == b.group && rule.group_b == a.group)) {
          out.push_back({i, k});
          break;
        }
    }
  return out;
}

class DrakeEngine final : public OtherEngine {
 public:
  DrakeEngine(const model::Model& model, const engine::Settings& settings, const DrakeOptions& options)
      : OtherEngine(model, settings),
        options_(options),
        child_(children().take(script())),
        counted_(child_->cpu()) {
    for (std::size_t i = 1; i < model.bodies.size(); ++i)
      if (!model.bodies[i].kinematic) bodies_.push_back(i);
    const std::string request = "M" + describe().dump() + "\n";
    if (!child_->send(request.data(), request.size())) refuse();
    for (char next = 0; child_->receive(&next, 1) && next != '\n';) version_ += next;
    if (version_.empty()) refuse();
    put(state());
    count_time();
  }

  ~DrakeEngine() override {
    if (answers_) children().give_back(std::move(child_));
  }

  std::string version() const override { return "Drake " + version_; }

 protected:
  void put(const model::State& state) override {
    std::vector<double> numbers;
    for (const std::size_t i : bodies_) {
      const model::BodyState& body = state.bodies[i];
      for (const Vec3& v : {body.p, Vec3(body.q.w(), body.q.x(), body.q.y())})
        numbers.insert(numbers.end(), v.data(), v.data() + 3);
      numbers.push_back(body.q.z());
      for (const Vec3& v : {body.v, body.w}) numbers.insert(numbers.end(), v.data(), v.data() + 3);
    }
    numbers.insert(numbers.end(), state.q.begin(), state.q.end());
    numbers.insert(numbers.end(), state.u.begin(), state.u.end());
    answers_ = tell('P', numbers) && listen();
    if (!answers_) refuse();
  }

  void advance(const engine::StepInput& input) override {
    if (!input.servos.empty())
      throw input_error("control", "servos", "none: Drake's gains are fixed at the start");
    std::vector<double> forces(input.torques.begin(), input.torques.end());
    forces.resize(static_cast<std::size_t>(model_.dof_count()));
    answers_ = tell('S', forces) && listen();
    if (!answers_) fail("no answer from Drake");
    count_time();
  }

  void read(model::State& state, std::vector<engine::Contact>& contacts) override {
    const double* at = answer_.data();
    for (const std::size_t i : bodies_) {
      state.bodies[i] = {Vec3(at[0], at[1], at[2]), Quat(at[3], at[4], at[5], at[6]),
                         Vec3(at[7], at[8], at[9]), Vec3(at[10], at[11], at[12])};
      at += kBodyNumbers;
    }
    for (std::size_t i = 0; i < contacts_.size() / kContactNumbers; ++i) {
      const double* c = contacts_.data() + kContactNumbers * i;
      contacts.push_back({static_cast<int>(c[0]), static_cast<int>(c[1]), Vec3(c[2], c[3], c[4]),
                          Vec3(c[5], c[6], c[7]), c[8], Vec3::Zero()});
    }
  }

 private:
  static const char* script() {
    const char* script = std::getenv("HANDSIM_DRAKE_STEPS");
    if (!script) throw input_error("HANDSIM_DRAKE_STEPS", "nothing", "where drake_steps.py is");
    return script;
  }
  [[noreturn]] static void refuse() {
    throw input_error("drake", "a model that it does not take", "another");
  }

  void count_time() {
    if (!options_.limit) return;
    const double now = child_->cpu();
    options_.limit->spent += now - std::exchange(counted_, now);
    require_time(options_, state().time);
  }

  Json describe() const {
    const bool tissue = settings_.effects.has(model::Effect::passive_tissue);
    Json names = Json::array(), springs = Json::array(), bodies = Json::array(), floating = Json::array(),
         shapes = Json::array();
    std::vector<bool> held(model_.bodies.size(), false);
    for (const model::Joint& joint : model_.joints) {
      held[static_cast<std::size_t>(joint.child)] = true;
      if (joint.kind == model::JointKind::ball && !joint.closes_loop)
        throw input_error(joint.name, "a ball joint", "another: Drake's has a singular place");
      for (int a = 0; a < model::dof_count(joint.kind); ++a) {
        const model::JointAxis* axis =
            joint.axes.empty() ? nullptr : &joint.axes[static_cast<std::size_t>(a)];
        names.push_back(joint.closes_loop || !axis ? "" : joint.name + "." + axis->name);
        const model::Tissue spring = tissue && axis && axis->tissue ? *axis->tissue : model::Tissue{};
        springs.push_back({spring.stiffness, spring.rest});
      }
    }
    for (const std::size_t i : bodies_) {
      bodies.push_back(model_.bodies[i].name);
      floating.push_back(!held[i]);
    }
    for (const model::Shape& shape : model_.shapes) shapes.push_back(shape.name);
    const Vec3 g = settings_.effects.has(model::Effect::gravity) ? model_.gravity : Vec3::Zero();
    return {{"mjcf", test::written("mjcf", model_, settings_)},
            {"step", settings_.step},
            {"approximation", options_.approximation},
            {"hydroelastic", options_.modulus > 0},
            {"hydroelastic_modulus", options_.modulus},
            {"stiction_tolerance", kStiction},
            {"point_stiffness", kPointStiffness},
            {"bodies", bodies},
            {"floating", floating},
            {"coordinates", names},
            {"springs", springs},
            {"shapes", shapes},
            {"pairs", pairs_of(model_, settings_)},
            {"gravity", {g.x(), g.y(), g.z()}}};
  }

  bool tell(char kind, const std::vector<double>& numbers) {
    return child_->send(&kind, 1) && child_->send(numbers.data(), 8 * numbers.size());
  }
  bool listen() {
    answer_.resize(kBodyNumbers * bodies_.size());
    double count = 0;
    if (!child_->receive(answer_.data(), 8 * answer_.size()) || !child_->receive(&count, 8)) return false;
    contacts_.resize(kContactNumbers * static_cast<std::size_t>(count));
    return child_->receive(contacts_.data(), 8 * contacts_.size());
  }

  const DrakeOptions options_;
  std::unique_ptr<Child> child_;
  bool answers_ = false;
  double counted_;  ///< of the child's CPU time, in the limit [s]
  std::string version_;
  std::vector<std::size_t> bodies_;  ///< that move
  std::vector<double> answer_, contacts_;
};

}  // namespace

std::unique_ptr<engine::Engine> make_drake(const model::Model& model, const engine::Settings& settings,
                                           const DrakeOptions& options) {
  require_time(options, 0);
  return std::make_unique<DrakeEngine>(model, settings, options);
}

}  // namespace handsim::peers
