// The recursive algorithms on random trees of every kind of joint: each against another way to the same
// numbers.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>
#include <random>

#include "engine/models.h"
#include "handsim/engine/articulated/articulated_engine.h"
#include "handsim/engine/articulated/kernels/spatial.h"
#include "handsim/model/energy.h"

namespace {
std::atomic<long> allocations = 0;
}

// Counts every allocation of the test program.
[[gnu::noinline]] void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
// Asked for by name: a sanitizer's own would not go together with the delete below.
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++allocations;
  return std::malloc(size);
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace handsim::engine::articulated {
namespace {

using model::Effect;
using model::JointKind;
using test::random_pose;
using test::random_vector;
using test::settings;

/// A tree of 14 bodies with every kind of joint, some hanging on the world, one on a kinematic body, one
/// free.
model::Model random_tree(std::mt19937& random) {
  model::Model model = model::make_model();
  model::Body palm = test::body("palm", 0.3, {3e-4, 3e-4, 5e-4}, random_pose(random));
  palm.kinematic = true;
  test::add_body(model, palm);
  std::uniform_real_distribution<double> u(0.5, 1.5);
  constexpr JointKind kKinds[] = {JointKind::hinge, JointKind::universal, JointKind::ball, JointKind::slider};
  const int free = test::add_body(model, test::body("free", 0.4, {2e-3, 3e-3, 4e-3}, random_pose(random)));
  for (int i = 0; i < 12; ++i) {
    model::Body body = test::body("b" + std::to_string(i), 0.1 * u(random), Vec3::Zero());
    const Mat3 turn = rotation_quaternion(random_vector(random)).toRotationMatrix();
    body.inertia = turn *
                   (1e-4 * Vec3(u(random), u(random), u(random)).array() + 1e-4).matrix().asDiagonal() *
                   turn.transpose();
    body.inertia = 0.5 * (body.inertia + body.inertia.transpose()).eval();
    const int child = test::add_body(model, body);
    const int parents[] = {0, 1, free, child - 1, child - 2};
    const int parent = parents[i < 3 ? i : static_cast<int>(random() % 5)];
    const JointKind kind = kKinds[i % 4];
    const Vec3 a = random_vector(random).normalized();
    std::vector<Vec3> axes;
    if (kind != JointKind::ball) axes.push_back(a);
    if (kind == JointKind::universal) axes.push_back(a.unitOrthogonal());
    test::add_joint(model, "j" + std::to_string(i), kind, parent, child, random_pose(random),
                    random_pose(random), axes);
  }
  return model;
}

/// Random positions, rates and forces on every coordinate of a mechanism of one lane.
void scatter(Mechanism& mechanism, std::mt19937& random) {
  std::uniform_real_distribution<double> u(-1, 1);
  for (double& q : mechanism.q()) q = 2 * u(random);
  for (double& rate : mechanism.u()) rate = 3 * u(random);
  const LaneTreeOf<1>& tree = lanes_of<1>(mechanism.tree());
  for (int i = 0; i < tree.batches; ++i) {
    const NodeBatch<1>& b = tree.batch[i];
    if (rate_count(b.kind) == 1)
      tree.axis[b.axis].tau[0] = u(random);
    else
      for (int k = 0; k < rate_count(b.kind); ++k) tree.joint3[b.axis].tau[k][0] = u(random);
  }
  mechanism.kernel().normalise(tree);
  for (int body : {0, 1}) {
    BaseMotion& base = mechanism.base(body);
    if (body == 1)
      base = {random_pose(random), random_vector(random), random_vector(random), random_vector(random),
              random_vector(random)};
  }
  mechanism.update_bases();
  mechanism.kernel().kinematics(tree);
}

std::vector<double> forces(const Mechanism& mechanism) {
  std::vector<double> out;
  const LaneTreeOf<1>& tree = lanes_of<1>(mechanism.tree());
  for (int i = 0; i < tree.batches; ++i) {
    const NodeBatch<1>& b = tree.batch[i];
    for (int k = 0; k < rate_count(b.kind); ++k)
      out.push_back(rate_count(b.kind) == 1 ? tree.axis[b.axis].tau[0] : tree.joint3[b.axis].tau[k][0]);
  }
  return out;
}

const Settings kGravity =
    settings({Effect::gravity, Effect::actuation}, 1e-3, ArticulatedMethod::semi_implicit_euler);

// Oracle: inverse dynamics of what forward dynamics gives. Bound: 1e-12 of the largest torque.
TEST(ArticulatedDynamics, InverseAfterForwardGivesTheTorquesBack) {
  std::mt19937 random(1);
  for (int tree = 0; tree < 50; ++tree) {
    const model::Model model = random_tree(random);
    Mechanism mechanism(model, kGravity, kernels().front());
    JointSpace space(mechanism);
    for (int sample = 0; sample < 20; ++sample) {
      scatter(mechanism, random);
      mechanism.kernel().prepare_smooth(mechanism.tree());
      mechanism.kernel().solve(mechanism.tree());
      const std::vector<double> want = forces(mechanism);
      std::vector<double> tau(want.size());
      space.inverse_dynamics(mechanism.du(), tau);
      for (std::size_t i = 0; i < tau.size(); ++i) EXPECT_NEAR(tau[i], want[i], 1e-12);
    }
  }
}

// Oracle: the equation of motion, column by column: H e_i = ID(q, u, e_i) - ID(q, u, 0); and its factor
// undoes it.
TEST(ArticulatedDynamics, InertiaMatrixIsWhatInverseDynamicsSays) {
  std::mt19937 random(2);
  for (int tree = 0; tree < 20; ++tree) {
    const model::Model model = random_tree(random);
    Mechanism mechanism(model, kGravity, kernels().front());
    JointSpace space(mechanism);
    scatter(mechanism, random);
    const auto n = static_cast<std::size_t>(space.size());
    std::vector<double> zero(n), bias(n), unit(n), column(n);
    space.inverse_dynamics(zero, bias);
    space.compute_inertia();
    Eigen::MatrixXd H(space.size(), space.size());
    for (int i = 0; i < space.size(); ++i) {
      unit.assign(n, 0);
      unit[static_cast<std::size_t>(i)] = 1;
      space.inverse_dynamics(unit, column);
      for (int j = 0; j < space.size(); ++j) {
        H(j, i) = column[static_cast<std::size_t>(j)] - bias[static_cast<std::size_t>(j)];
        EXPECT_NEAR(space.inertia(std::max(i, j), std::min(i, j)), H(j, i), 1e-12);
      }
    }
    space.factor();
    Eigen::VectorXd x = Eigen::VectorXd::Random(space.size());
    Eigen::VectorXd solved = x;
    space.solve_transposed({solved.data(), n});
    space.solve_factor({solved.data(), n});
    EXPECT_LT((H * solved - x).norm(), 1e-9 * x.norm());
  }
}

// Oracle: kinetic energy of the bodies, and the velocity of a point of a body.
TEST(ArticulatedDynamics, EnergyAndPointVelocitiesAreThoseOfTheBodies) {
  std::mt19937 random(3);
  for (int tree = 0; tree < 20; ++tree) {
    model::Model model = random_tree(random);
    Mechanism mechanism(model, kGravity, kernels().front());
    JointSpace space(mechanism);
    scatter(mechanism, random);
    mechanism.base(1).v = mechanism.base(1).w = Vec3::Zero();
    mechanism.update_bases();
    mechanism.kernel().velocities(mechanism.tree());
    model::State state = model::initial_state(model);
    mechanism.store_state(state);
    space.compute_inertia();
    const Eigen::Map<Eigen::VectorXd> u(mechanism.u().data(), space.size());
    double energy = 0;
    for (int i = 0; i < space.size(); ++i)
      for (int j = 0; j < space.size(); ++j)
        energy += 0.5 * u[i] * u[j] * space.inertia(std::max(i, j), std::min(i, j));
    EXPECT_NEAR(energy, model::kinetic_energy(model, state), 1e-12 * energy);
    for (std::size_t body = 2; body < model.bodies.size(); ++body) {
      const int node = mechanism.topology().node_of_body[body];
      const Vec3 origin = mechanism.origin(mechanism.topology().nodes[static_cast<std::size_t>(node)].island);
      const model::BodyState& at = state.bodies[body];
      const Vec3 local(0.01, -0.02, 0.03);
      const Vec3 point = at.pose() * local;
      const Vec3 want = at.v + at.w.cross(point - at.p);
      for (int k = 0; k < 3; ++k) {
        articulated::Spatial force;
        force << (point - origin).cross(Vec3::Unit(k)), Vec3::Unit(k);
        std::vector<double> row(static_cast<std::size_t>(space.size()));
        space.add_row(node, force, 1, row);
        const double rate = Eigen::Map<const Eigen::VectorXd>(row.data(), space.size()).dot(u);
        EXPECT_NEAR(rate, want[k], 1e-12 * (1 + want.norm()));
      }
    }
  }
}

// Oracle: going there and back. Bound: 1e-12.
TEST(ArticulatedDynamics, CoordinatesAndBodyPosesAreExactBothWays) {
  std::mt19937 random(4);
  for (int tree = 0; tree < 50; ++tree) {
    const model::Model model = random_tree(random);
    Mechanism mechanism(model, kGravity, kernels().front());
    scatter(mechanism, random);
    model::State state = model::initial_state(model);
    const BaseMotion base = mechanism.base(1);
    state.bodies[1] = {base.pose.p, base.pose.q, base.v, base.w};
    mechanism.store_state(state);
    EXPECT_LT(*std::max_element(mechanism.q().begin(), mechanism.q().end(),
                                [](double a, double b) { return std::abs(a) < std::abs(b); }),
              10);
    for (const model::Joint& joint : model.joints) EXPECT_LT(model::joint_gap(joint, state), 1e-14);
    Mechanism other(model, kGravity, kernels().back());
    other.load_state(state);
    other.kernel().kinematics(other.tree());
    model::State back = state;
    other.store_state(back);
    for (std::size_t i = 0; i < state.bodies.size(); ++i) {
      EXPECT_LT((back.bodies[i].p - state.bodies[i].p).norm(), 1e-12);
      EXPECT_LT(back.bodies[i].q.angularDistance(state.bodies[i].q), 1e-12 * 10);
      EXPECT_LT((back.bodies[i].v - state.bodies[i].v).norm(), 1e-12 * (1 + state.bodies[i].v.norm()));
      EXPECT_LT((back.bodies[i].w - state.bodies[i].w).norm(), 1e-12 * (1 + state.bodies[i].w.norm()));
    }
  }
}

std::vector<std::uint64_t> bits_after(const model::Model& model, const Settings& with, const Kernel* kernel) {
  ArticulatedEngine engine(model, with, kernel);
  const std::vector<model::Servo> servos(static_cast<std::size_t>(model.dof_count()),
                                         {0.2, 1e-3, 0.3, 0, 0.02});
  std::vector<model::Servo> none(servos.size());
  bool driven = with.effects.has(Effect::actuation);
  for (int i = 0; i < 200; ++i)
    engine.step({.servos = driven ? std::span(servos) : std::span<model::Servo>()});
  return test::bits(engine.state());
}

// Oracle: bit equality. Each lane does what a single one does, whatever the register's width.
TEST(ArticulatedDynamics, EveryVectorUnitGivesTheSameBits) {
  if (kernels().size() < 2) GTEST_SKIP() << "this processor has one";
  model::Model fingers = test::five_fingers(true, true);
  const Settings hand =
      settings({Effect::gravity, Effect::passive_tissue, Effect::joint_stops, Effect::actuation}, 1e-3,
               ArticulatedMethod::semi_implicit_euler);
  std::mt19937 random(5);
  const model::Model tree = random_tree(random);
  const Settings plain = settings({Effect::gravity}, 1e-3, ArticulatedMethod::rk4);
  const auto want = bits_after(fingers, hand, kernels().front());
  const auto want_tree = bits_after(tree, plain, kernels().front());
  fingers.bodies[1].kinematic = false;
  const auto want_free = bits_after(fingers, hand, kernels().front());
  for (const Kernel* kernel : kernels()) {
    EXPECT_EQ(bits_after(fingers, hand, kernel), want_free) << kernel->name;
    EXPECT_EQ(bits_after(tree, plain, kernel), want_tree) << kernel->name;
  }
  fingers.bodies[1].kinematic = true;
  for (const Kernel* kernel : kernels()) EXPECT_EQ(bits_after(fingers, hand, kernel), want) << kernel->name;
}

/// The orientation of a node's link.
template <int W>
Quat link_orientation(const Mechanism& mechanism, const LaneSlot& slot) {
  const auto& q = lanes_of<W>(mechanism.tree()).batch[slot.batch].frame.quat;
  return {q[3][slot.lane], q[0][slot.lane], q[1][slot.lane], q[2][slot.lane]};
}
Quat link_orientation(const Mechanism& mechanism, const LaneSlot& slot) {
  switch (mechanism.kernel().width) {
    case 2:
      return link_orientation<2>(mechanism, slot);
    case 4:
      return link_orientation<4>(mechanism, slot);
    case 8:
      return link_orientation<8>(mechanism, slot);
    default:
      return link_orientation<1>(mechanism, slot);
  }
}

// Oracle: the same products by Eigen, node by node; the composite-rigid-body algorithm for the inertia. Equal
// to the bit: states are, whichever way they are found.
TEST(ArticulatedDynamics, PosesAndInertiaInLanesHaveTheBitsOfEigensProducts) {
  std::mt19937 random(8);
  const model::Model fingers = test::five_fingers(true, true);
  for (const Kernel* kernel : kernels()) {
    Mechanism mechanism(fingers, kGravity, kernel);
    const std::vector<Node>& nodes = mechanism.topology().nodes;
    std::uniform_real_distribution<double> u(-1, 1);
    for (double& q : mechanism.q()) q = 2 * u(random);
    for (double& rate : mechanism.u()) rate = 3 * u(random);
    mechanism.kernel().kinematics(mechanism.tree());
    const std::size_t s = mechanism.stride();

    model::State state = model::initial_state(fingers);
    mechanism.store_state(state);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (!nodes[i].body) continue;
      const NodeView& view = mechanism.view(i);
      const model::BodyState& body = state.bodies[as_index(*nodes[i].body)];
      const Quat q = (link_orientation(mechanism, mechanism.slot(i)) * nodes[i].q_LB).normalized();
      const Vec3 w = read3(view.v, s), p = read3(view.p, s), v = read3(view.v + 3 * s, s) + w.cross(p);
      EXPECT_EQ(body.q.coeffs(), q.coeffs()) << kernel->name;
      EXPECT_EQ(body.v, v) << kernel->name;
      EXPECT_EQ(body.p, mechanism.origin(nodes[i].island) + p) << kernel->name;
    }

    JointSpace space(mechanism);
    space.compute_inertia();
    std::vector<double> mass;
    std::vector<Vec3> h;
    std::vector<Mat3> I;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      mass.push_back(*mechanism.view(i).mass);
      h.push_back(read3(mechanism.view(i).h, s));
      I.push_back(read_symmetric(mechanism.view(i).I, s));
    }
    for (std::size_t i = nodes.size(); i-- > 0;) {
      const int dof = space.first_dof(static_cast<int>(i));
      const Spatial S = space.axis(dof);
      const Vec3 turn = S.head<3>(), shift = S.tail<3>();
      Spatial F;
      F << I[i] * turn + h[i].cross(shift), mass[i] * shift - h[i].cross(turn);
      for (int j = dof; j != kNoDof; j = space.parent_dof(j))
        EXPECT_EQ(space.inertia(dof, j), space.axis(j).dot(F)) << kernel->name;
      if (!nodes[i].parent) continue;
      const std::size_t parent = as_index(*nodes[i].parent);
      mass[parent] += mass[i];
      h[parent] += h[i];
      I[parent] += I[i];
    }
  }
}

// Oracle: the program's own count of allocations.
TEST(ArticulatedDynamics, AStepAllocatesNothing) {
  model::Model model = test::five_fingers(true, true, true);
  model::Drive drive;
  drive.body = 1;
  drive.motion.keys = {{0, {}}, {0.1, Pose{Vec3(0.1, 0, 0), rotation_quaternion({1, 0, 0})}}};
  model.drives.push_back(drive);
  int touching = 0;
  const auto count = [&](Settings with) {
    const auto engine = make_engine(model, with);
    std::vector<model::Servo> servos(static_cast<std::size_t>(model.dof_count()), {0.2, 1e-3, 0.3, 0, 0.02});
    // Together, so that fingers touch.
    for (std::size_t finger = 0; finger < 5; ++finger) servos[4 * finger + 1].error = finger < 2 ? -0.5 : 0.5;
    const std::vector<double> torques(servos.size(), 1e-3);
    for (int i = 0; i < 50; ++i) engine->step({torques, servos});
    engine->step({torques, servos});
    const long before = allocations;
    for (int i = 0; i < 150; ++i) {
      touching += engine->step({torques, servos}).contacts;
      EXPECT_LT(engine->state().bodies[2].p.norm(), 1);
    }
    return allocations - before;
  };
  Settings with = settings({Effect::gravity, Effect::passive_tissue, Effect::actuation, Effect::wrist_motion},
                           1e-3, ArticulatedMethod::semi_implicit_euler);
  with.effects.add(Effect::joint_stops);
  EXPECT_EQ(count(with), 0);
  with.effects.add(Effect::self_contact);
  with.effects.add(Effect::friction);
  EXPECT_EQ(count(with), 0);
  EXPECT_GT(touching, 10);
  with.effects.remove(Effect::self_contact);
  with.effects.remove(Effect::joint_stops);
  for (const Method method : {ArticulatedMethod::rk4, ArticulatedMethod::dormand_prince}) {
    with.use(method);
    EXPECT_EQ(count(with), 0) << name(method);
  }
  EXPECT_GT(allocations, 0);
}

// Oracle: the C library, whose sine and cosine are right to the last place.
TEST(ArticulatedDynamics, SineAndCosineAreRightToRounding) {
  double worst = 0;
  for (int i = -200000; i <= 200000; ++i) {
    const double x = 1e-3 * i + 1e-7 * (i % 977);
    double s = 0, c = 0;
    sine_cosine(x, s, c);
    worst = std::max({worst, std::abs(s - std::sin(x)), std::abs(c - std::cos(x))});
  }
  EXPECT_LT(worst, 4e-16);
}

}  // namespace
}  // namespace handsim::engine::articulated
