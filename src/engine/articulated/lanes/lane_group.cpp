#include "handsim/engine/articulated/lanes/lane_group.h"

#include <algorithm>
#include <array>

#include "handsim/engine/articulated/articulated_engine.h"
#include "handsim/engine/articulated/dynamics/spin.h"
#include "handsim/engine/articulated/lanes/mechanism_exchange.h"
#include "handsim/engine/checks.h"

namespace handsim::engine::articulated {

namespace {

/// Corrections of stops and torque limits in lanes, before engines find theirs alone.
constexpr int kCorrections = 8;

template <int W>
class GroupOf final : public LaneGroup {
 public:
  GroupOf(const ArticulatedEngine& like, const Kernel& kernel)
      : kernel_(kernel),
        step_(like.settings().step),
        lanes_(like.mechanism().topology(), like.model().bodies.size(), at(like.model().dof_count())) {
    const Topology& topology = like.mechanism().topology();
    lanes_.tree.erp = like.settings().erp();
    slot_of_dof_.assign(at(like.model().dof_count()), 0);
    q_ = u_ = std::vector<double>(slot_of_dof_.size());
    for (std::size_t i = 0; i < topology.nodes.size(); ++i) {
      const Node& node = topology.nodes[i];
      if (node.joint) slot_of_dof_[at(like.model().joints[at(*node.joint)].first_dof + node.axis_index)] = i;
      if (node.kind != NodeKind::free) continue;
      free_.push_back({i, at(node.island), like.mechanism().is_lone(i)});
    }
    if (like.muscles()) compute_coupling(*like.muscles(), topology);
  }

  int width() const override { return W; }

  bool fits(Engine& other, bool driven) const override {
    auto& engine = static_cast<ArticulatedEngine&>(other);
    return engine.stands() && !engine.spins_beyond(coupled_ ? kPulledTurn
                                                   : driven ? kDrivenTurn
                                                            : kPassiveTurn);
  }

  void set_constants(int lane, Engine& other, const LaneControlPlan* plan, std::uint64_t key) override {
    auto& engine = static_cast<ArticulatedEngine&>(other);
    key_[at(lane)] = key;
    engine.mechanism().lend_constants(lanes_, lane);
    std::vector<model::Servo>& servos = servos_[at(lane)];
    servos.assign(plan ? slot_of_dof_.size() : 0, {});
    if (plan) {
      for (const LaneDrive& drive : plan->drives) servos[drive.dof].limit = drive.limit;
      load_control(lane, engine.model(), *plan);
    } else {
      lanes_.servos.clear();
      lanes_.weights.clear();
    }
    limp_.clear();
    for (std::size_t dof = 0; dof < slot_of_dof_.size(); ++dof) {
      if (!single(lanes_.batches[slot_of_dof_[dof]].kind)) continue;
      if (servos.empty() || servos[dof].limit == 0) limp_.push_back(slot_of_dof_[dof]);
      Axis<W>& a = axis(slot_of_dof_[dof]);
      for (auto* of_servo :
           {&a.servo_stiffness, &a.servo_damping, &a.servo_error, &a.servo_feed, &a.servo_limit})
        (*of_servo)[lane] = 0;
    }
    saved_.resize(2 * lanes_.axes.size() + 3 * lanes_.u.size() + lanes_.q.size() + 5 * lanes_.servos.size());
  }
  std::optional<std::uint64_t> key(int lane) const override { return key_[at(lane)]; }

  void load(int lane, Engine& other, std::span<const double> torques,
            std::span<const double> excitations) override {
    auto& engine = static_cast<ArticulatedEngine&>(other);
    input_[at(lane)] = {.torques = torques, .excitations = excitations};
    engine_[at(lane)] = &engine;
    filled_[at(lane)] = true;
    moved_[at(lane)] = collided_[at(lane)] = false;
    time_[at(lane)] = engine.time();
    engine.mechanism().lend(lanes_, lane);
    for (std::size_t dof = 0; dof < slot_of_dof_.size(); ++dof)
      if (single(lanes_.batches[slot_of_dof_[dof]].kind))
        axis(slot_of_dof_[dof]).tau[lane] = torques.empty() ? 0 : torques[dof];
    for (const std::size_t node : limp_) axis(node).saturated[lane] = 0;
    calm_[at(lane)] = engine.calm_turn({.torques = torques, .servos = servos_[at(lane)]});
  }

  void set_drive_state(int lane, std::size_t drive, const LaneDriveState& state) override {
    LaneServo<W>& servo = lanes_.servos[drive];
    servo.torque[lane] = state.torque;
    servo.at_limit[lane] = state.at_limit ? 1 : 0;
    servo.integral[lane] = state.integral;
    servo.filtered_rate[lane] = state.filtered_rate;
    servo.reached[lane] = state.target;
  }
  LaneDriveState drive_state(int lane, std::size_t drive) const override {
    const LaneServo<W>& servo = lanes_.servos[drive];
    const Batch<W>& b = lanes_.batches[at(servo.batch)];
    return {lanes_.tree.q[b.q + lane], lanes_.tree.u[b.u + lane], servo.reached[lane],
            servo.torque[lane],        servo.at_limit[lane] != 0, servo.integral[lane],
            servo.filtered_rate[lane]};
  }
  void set_target(int lane, std::size_t drive, double target) override {
    lanes_.servos[drive].target[lane] = target;
  }
  void set_targets(std::size_t drive, double target) override {
    std::fill_n(lanes_.servos[drive].target, W, target);
  }

  void start() override {
    lanes_.update_control();
    fill();
    needs_bodies_ = lanes_.control.weights > 0 || engine_[at(first())]->tests_contacts();
    kernel_.kinematics(lanes_.tree);
    place_bodies();
  }

  double time(int lane) const override { return time_[at(lane)]; }

  unsigned step() override {
    fill();
    unsigned leave = 0;
    for (int lane = 0; lane < W; ++lane) {
      const double turn = calm_[at(lane)];
      if (engine_[at(lane)] && (lanes_.tree.spin[lane] * step_ * step_ > turn * turn || !collide(lane)))
        leave |= 1U << lane;
    }
    save();
    if (coupled_) pull_tendons(leave);
    kernel_.lanes.command(lanes_.tree, lanes_.control, step_);
    add_gyroscopic_torques();
    if (!accelerate() || !kernel_.advance(lanes_.tree, step_)) {
      for (int lane = 0; lane < W; ++lane)
        if (coupled_ && engine_[at(lane)] && ((leave >> lane) & 1U) == 0)
          engine_[at(lane)]->muscles()->go_back();
      return restore();
    }
    if (coupled_) kernel_.lanes.compute_torques(memory_.rows(), step_);
    kernel_.lanes.observe(lanes_.tree, lanes_.control);
    place_bodies();
    if (leave != 0) keep_back(leave);
    for (int lane = 0; lane < W; ++lane)
      if (engine_[at(lane)] && ((leave >> lane) & 1U) == 0) {
        time_[at(lane)] = next_time(time_[at(lane)], step_);
        moved_[at(lane)] = true;
        collided_[at(lane)] = false;
      }
    return leave;
  }

  void store(int lane, bool leaves) override {
    ArticulatedEngine& engine = *engine_[at(lane)];
    if (moved_[at(lane)]) {
      engine.mechanism().take_back(lanes_, lane);
      // Bodies are those of the end of the last step.
      if (!leaves && !bodies_placed_) {
        kernel_.lanes.place_bodies(lanes_.tree, lanes_.control);
        bodies_placed_ = true;
      }
      if (!leaves) give_bodies(lane);
      engine.arrive_from_lanes(time_[at(lane)], !leaves);
    }
    engine.set_collided(collided_[at(lane)]);
    engine_[at(lane)] = nullptr;
    filled_[at(lane)] = false;
  }

 private:
  struct Free {
    std::size_t node, island;
    bool lone;
  };

  int first() const {
    return static_cast<int>(
        std::ranges::find_if(engine_, [](const auto* engine) { return engine != nullptr; }) -
        engine_.begin());
  }
  /// Lanes without an engine do what another one does.
  void fill() {
    for (int lane = 0; lane < W; ++lane) {
      if (filled_[at(lane)]) continue;
      copy(first(), lane);
      key_[at(lane)] = key_[at(first())];
      filled_[at(lane)] = true;
    }
  }
  Axis<W>& axis(std::size_t node) { return lanes_.axes[at(lanes_.batches[node].axis)]; }

  void load_control(int lane, const model::Model& model, const LaneControlPlan& plan) {
    lanes_.servos.resize(plan.drives.size());
    lanes_.weights.resize(plan.links.size());
    for (std::size_t i = 0; i < plan.drives.size(); ++i) {
      const LaneDrive& drive = plan.drives[i];
      LaneServo<W>& servo = lanes_.servos[i];
      servo.batch = static_cast<int>(slot_of_dof_[drive.dof]);
      servo.dof = static_cast<int>(drive.dof);
      servo.proportional[lane] = drive.proportional;
      servo.derivative[lane] = drive.derivative;
      servo.integral_gain[lane] = drive.integral;
      servo.limit[lane] = drive.limit;
      servo.zone[lane] = drive.zone;
      servo.smoothing[lane] = drive.smoothing;
      servo.tissue_stiffness[lane] = drive.tissue_stiffness;
      servo.tissue_rest[lane] = drive.tissue_rest;
      servo.target[lane] = drive.target;
    }
    for (std::size_t i = 0; i < plan.links.size(); ++i) {
      const LaneLink& link = plan.links[i];
      LaneWeight<W>& weight = lanes_.weights[i];
      weight.parent = static_cast<int>(link.parent);
      weight.child = static_cast<int>(link.child);
      weight.dof = static_cast<int>(link.dof);
      weight.adds_to_parent = link.adds_to_parent;
      weight.turns = link.turns;
      weight.universal = link.universal;
      weight.mass[lane] = link.mass;
      put3<W>(weight.frame, lane, link.frame);
      put3<W>(weight.first_axis, lane, link.first_axis);
      put3<W>(weight.second_axis, lane, link.second_axis);
      lanes_.bodies[link.child].mass[lane] = model.bodies[link.child].mass;
    }
    put3<W>(gravity(), lane, plan.gravity);
  }
  Lane<W>* gravity() { return reinterpret_cast<Lane<W>*>(lanes_.data(lanes_.gravity)); }

  /// All numbers of a lane to another one.
  void copy(int from, int to) {
    const auto each = [&](auto& items) {
      using Item = typename std::remove_reference_t<decltype(items)>::value_type;
      for (Item& item : items) {
        auto* x = reinterpret_cast<double*>(&item);
        for (std::size_t i = 0; i < numbers_of(item); ++i) x[i * W + at(to)] = x[i * W + at(from)];
      }
    };
    each(lanes_.batches);
    each(lanes_.axes);
    each(lanes_.joints3);
    each(lanes_.bases);
    each(lanes_.bodies);
    each(lanes_.weights);
    each(lanes_.servos);
    for (auto* numbers : {&lanes_.q, &lanes_.u, &lanes_.du, &lanes_.tau, &lanes_.tau_servo, &lanes_.spin,
                          &lanes_.origins, &lanes_.gravity, &lanes_.loads})
      each(*numbers);
  }
  /// Lanes of numbers that a structure begins with.
  template <class Item>
  static std::size_t numbers_of(const Item& item) {
    const auto until = [&](const auto& member) {
      return at(reinterpret_cast<const std::byte*>(&member) - reinterpret_cast<const std::byte*>(&item)) /
             sizeof(Lane<W>);
    };
    if constexpr (std::is_same_v<Item, Batch<W>>)
      return until(item.kind);
    else if constexpr (std::is_same_v<Item, LaneBody<W>> || std::is_same_v<Item, LaneServo<W>>)
      return until(item.batch);
    else if constexpr (std::is_same_v<Item, LaneWeight<W>>)
      return until(item.parent);
    else
      return sizeof(Item) / sizeof(Lane<W>);
  }

  void place_bodies() {
    for (const Free& each : free_)
      for (int k = 0; k < 3; ++k) {
        const double* q = lanes_.tree.q + lanes_.batches[each.node].q + k * W;
        std::copy_n(q, W, lanes_.origins[3 * each.island + at(k)].x);
      }
    bodies_placed_ = needs_bodies_;
    if (needs_bodies_) kernel_.lanes.place_bodies(lanes_.tree, lanes_.control);
  }

  void give_bodies(int lane) {
    model::State& state = engine_[at(lane)]->state_in_lanes();
    for (std::size_t i = 0; i < lanes_.bodies.size(); ++i) {
      const LaneBody<W>& body = lanes_.bodies[i];
      if (body.of_node)
        state.bodies[i] = {get3<W>(body.p, lane), get4<W>(body.q, lane), get3<W>(body.v, lane),
                           get3<W>(body.w, lane)};
    }
  }

  /// False where an engine has contacts in the step to come.
  bool collide(int lane) {
    ArticulatedEngine& engine = *engine_[at(lane)];
    if (!engine.tests_contacts()) return true;
    give_bodies(lane);
    collided_[at(lane)] = engine.find_contacts();
    return collided_[at(lane)] && engine.contacts().empty();
  }

  void add_gyroscopic_torques() {
    for (const Free& each : free_) {
      if (!each.lone) continue;
      Batch<W>& b = lanes_.batches[each.node];
      for (int lane = 0; lane < W; ++lane) {
        const auto* q = reinterpret_cast<const Lane<W>*>(lanes_.tree.q + b.q);
        const auto* u = reinterpret_cast<const Lane<W>*>(lanes_.tree.u + b.u);
        if (const auto torque =
                gyroscopic_torque(get3<W>(b.inertia, lane), get4<W>(q + 3, lane), get3<W>(u, lane), step_))
          put3<W>(b.pv, lane, *torque);
      }
    }
  }

  bool accelerate() {
    for (int i = 0; i < kCorrections; ++i) {
      if (!coupled_) {
        if (kernel_.accelerate(lanes_.tree, step_)) return true;
        continue;
      }
      kernel_.prepare(lanes_.tree, step_);
      kernel_.solve(lanes_.tree);
      if (i == 0) kernel_.inertia(lanes_.tree, memory_.rows().inertia);
      kernel_.lanes.couple(memory_.rows(), step_);
      if (kernel_.update_active_set(lanes_.tree, step_, false)) return true;
    }
    return false;
  }

  void compute_coupling(const MuscleCoupling& muscles, const Topology& topology) {
    coupled_ = true;
    std::vector<std::size_t> first;
    std::size_t inertia = 0;
    for (const Node& node : topology.nodes) {
      first.push_back(inertia);
      if (single(node.kind)) inertia += at(node.depth) + 1;
    }
    muscles.make(memory_, inertia, first, W);
    for (std::size_t i = 0; i < memory_.dofs.size(); ++i) {
      const auto node = at(muscles.node(i));
      const Batch<W>& b = lanes_.batches[node];
      Axis<W>& a = axis(node);
      memory_.dofs[i].du = lanes_.tree.du + b.u;
      memory_.dofs[i].tau = lanes_.tree.tau + b.u;
      memory_.dofs[i].force = a.force;
      memory_.dofs[i].reaction = a.reaction;
      memory_.dofs[i].weight = a.weight;
      memory_.dofs[i].side = a.side;
    }
  }

  /// Tendon torques and B of lanes that stay; the others keep theirs; those without an engine copy another's.
  void pull_tendons(unsigned leave) {
    int like = W;
    for (int lane = 0; lane < W; ++lane) {
      if (!engine_[at(lane)] || ((leave >> lane) & 1U) != 0) continue;
      if (like == W) like = lane;
      MuscleCoupling& muscles = *engine_[at(lane)]->muscles();
      for (std::size_t dof = 0; dof < q_.size(); ++dof) {
        const Batch<W>& b = lanes_.batches[slot_of_dof_[dof]];
        q_[dof] = lanes_.tree.q[b.q + lane];
        u_[dof] = lanes_.tree.u[b.u + lane];
      }
      muscles.keep();
      muscles.begin(q_, u_, input_[at(lane)]);
      set_tendons(lane, muscles);
    }
    for (int lane = 0; lane < W && like < W; ++lane)
      if (!engine_[at(lane)]) set_tendons(lane, *engine_[at(like)]->muscles());
  }
  void set_tendons(int lane, const MuscleCoupling& muscles) {
    const std::span<const double> torques = muscles.given(), slopes = muscles.slopes();
    for (std::size_t dof = 0; dof < torques.size(); ++dof)
      if (single(lanes_.batches[slot_of_dof_[dof]].kind)) axis(slot_of_dof_[dof]).tau[lane] = torques[dof];
    for (std::size_t k = 0; k < slopes.size(); ++k) memory_.rows().slope[k * W + at(lane)] = slopes[k];
  }

  /// What a step changes, as f(first, second) of equal ranges of numbers: as it is, and as it was saved.
  template <class F>
  void each_state(const F& f) {
    double* then = saved_[0].x;
    const auto pass = [&](double* now, std::size_t count) {
      f(now, then, count);
      then += count;
    };
    const Tree& tree = lanes_.tree;
    pass(tree.q, at(tree.positions));
    for (double* rates : {tree.u, tree.tau, tree.tau_servo}) pass(rates, at(tree.rates));
    // Side by side in the Axis, and in the LaneServo.
    for (Axis<W>& a : lanes_.axes) pass(a.side, 2 * W);
    for (LaneServo<W>& servo : lanes_.servos) pass(servo.integral, 5 * W);
  }
  void save() {
    each_state([](const double* now, double* then, std::size_t count) { std::copy_n(now, count, then); });
  }
  /// To the start of the step. @returns all engines: each takes the step alone
  unsigned restore() {
    each_state([](double* now, const double* then, std::size_t count) { std::copy_n(then, count, now); });
    unsigned all = 0;
    for (int lane = 0; lane < W; ++lane) all |= engine_[at(lane)] ? 1U << lane : 0U;
    return all;
  }
  /// Some lanes to the start of the step.
  void keep_back(unsigned which) {
    each_state([&](double* now, const double* then, std::size_t count) {
      for (std::size_t i = 0; i < count; ++i)
        if ((which >> (i % W)) & 1U) now[i] = then[i];
    });
  }

  const Kernel& kernel_;
  double step_;
  LaneTree<W> lanes_;
  std::vector<Free> free_;
  std::vector<std::size_t> slot_of_dof_;  ///< node of each dof
  std::array<ArticulatedEngine*, W> engine_{};
  std::array<std::optional<std::uint64_t>, W> key_;
  std::array<bool, W> filled_{};
  std::array<bool, W> moved_{};     ///< since it was loaded
  std::array<bool, W> collided_{};  ///< the contacts of the step to come are known
  std::array<double, W> time_{}, calm_{};
  std::array<StepInput, W> input_{};
  TendonMemory memory_;
  bool coupled_ = false;  ///< by tendons
  std::vector<double> q_, u_;
  std::vector<typename LaneTree<W>::Numbers> saved_;
  std::array<std::vector<model::Servo>, W> servos_;  ///< their limits
  std::vector<std::size_t> limp_;                    ///< nodes that no servo drives
  bool needs_bodies_ = false;                        ///< in every step
  bool bodies_placed_ = false;                       ///< where the last step ended
};

}  // namespace

std::unique_ptr<LaneGroup> LaneGroup::make(const Engine& engine, int widest) {
  const auto* like = dynamic_cast<const ArticulatedEngine*>(&engine);
  if (!like || !like->suits_lanes()) return nullptr;
  const Kernel* best = nullptr;
  for (const Kernel* kernel : kernels())
    if (kernel->width <= widest) best = kernel;
  switch (best ? best->width : 1) {
    case 2:
      return std::make_unique<GroupOf<2>>(*like, *best);
    case 4:
      return std::make_unique<GroupOf<4>>(*like, *best);
    case 8:
      return std::make_unique<GroupOf<8>>(*like, *best);
    default:
      return nullptr;
  }
}

}  // namespace handsim::engine::articulated
