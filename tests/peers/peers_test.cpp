// The other engines build the mechanism that the scene describes. Oracle: the exact solution of the
// slider-crank, to which each converges at the order of its method. Skipped where a peer is not built;
// HANDSIM_NEED_PEERS names those that have to be there.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <ostream>

#include "peers/peer_program.h"
#include "scene_files.h"

namespace handsim::study {
namespace {

namespace fs = std::filesystem;

/// The engine's name is that of its program without `peer_`.
bool is_built(const std::string& engine) {
  return fs::exists(fs::path(HANDSIM_PEERS_FOLDER) / ("peer_" + engine));
}

bool is_needed(const std::string& engine) {
  const char* needed = std::getenv("HANDSIM_NEED_PEERS");
  return needed && (" " + std::string(needed) + " ").find(" " + engine + " ") != std::string::npos;
}

#define SKIP_UNLESS_BUILT(engine)                                           \
  if (!is_built(engine)) {                                                  \
    ASSERT_FALSE(is_needed(engine)) << "peer_" << (engine) << " is needed"; \
    GTEST_SKIP() << "peer_" << (engine) << " is not built";                 \
  }

struct Variant {
  const char* scene;
  Reference reference;
};
const Variant kIftomm = {"config/slider_crank_iftomm.yaml", Reference::slider_crank_iftomm};
const Variant kTorque = {"config/slider_crank_torque.yaml", Reference::slider_crank_torque};

AccuracySpec study(const Variant& variant, const PeerMethod& peer, std::vector<double> steps,
                   const fs::path& folder = HANDSIM_PEERS_FOLDER) {
  AccuracySpec spec;
  spec.scene = test::source(variant.scene);
  spec.reference = variant.reference;
  spec.observe = "slide";
  spec.repeats = 1;
  AccuracyMethod method;
  method.name = peer.program;
  method.outside = outside_engine(folder, peer);
  method.steps = std::move(steps);
  spec.methods.push_back(std::move(method));
  return spec;
}

/// Rows without a fault.
std::vector<AccuracyRow> rows(const AccuracySpec& spec) {
  const AccuracyResult result = run_accuracy(spec, nullptr);
  for (const AccuracyRow& row : result.rows) EXPECT_EQ(row.fault.value_or(""), "");
  return result.rows;
}

/// The study cut to its early window, of which an order of convergence is told.
AccuracySpec early(AccuracySpec spec) {
  spec.methods[0].set = {"duration=0.5"};
  return spec;
}

/// Order of convergence of the early error between two steps.
double order(const AccuracyRow& coarse, const AccuracyRow& fine) {
  return std::log(coarse.early_rate_error / fine.early_rate_error) / std::log(coarse.step / fine.step);
}

struct FirstOrder {
  const char* engine;
  PeerMethod method;
};

/// What test names show.
void PrintTo(const FirstOrder& peer, std::ostream* out) { *out << peer.engine; }

class FirstOrderPeer : public testing::TestWithParam<FirstOrder> {};

// Semi-implicit Euler is of order 1, where the constraint is solved well enough (Bullet's 10 iterations are
// not). At 0.1 ms the early error is 1e-3 of the signal.
TEST_P(FirstOrderPeer, ConvergesToTheExactMotionOfBothVariants) {
  SKIP_UNLESS_BUILT(GetParam().engine);
  for (const Variant& variant : {kIftomm, kTorque}) {
    const std::vector<AccuracyRow> row = rows(early(study(variant, GetParam().method, {5e-4, 1e-4})));
    ASSERT_EQ(row.size(), 2U);
    EXPECT_GE(order(row[0], row[1]), 0.8) << variant.scene;
    EXPECT_LE(order(row[0], row[1]), 1.2) << variant.scene;
    EXPECT_LE(row[1].early_rate_error, 2e-3) << variant.scene;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Engines, FirstOrderPeer,
    testing::Values(FirstOrder{"mujoco", {"peer_mujoco", "euler", {}}},
                    FirstOrder{"dart", {"peer_dart", "semi_implicit_euler", {{"erp", 0.2}}}},
                    FirstOrder{"bullet", {"peer_bullet", "semi_implicit_euler", {{"iterations", 100}}}},
                    FirstOrder{"simbody",
                               {"peer_simbody", "semi_explicit_euler", {{"constraint_tolerance", 1e-10}}}}),
    [](const auto& one) { return std::string(one.param.engine); });

// 1e-8 m/s: two solutions of the same equations, each with error control of 1e-10 and better.
TEST(Simbody, ErrorControlledAgreesWithTheExactMotionTo1e8Over5Seconds) {
  SKIP_UNLESS_BUILT("simbody");
  const PeerMethod method = {"peer_simbody", "runge_kutta_merson", {{"accuracy", 1e-10}}};
  const std::vector<AccuracyRow> row = rows(study(kIftomm, method, {0.01}));
  EXPECT_LE(row.at(0).rate_error, 1e-8);
  EXPECT_LE(row.at(0).position_error, 1e-8);
  EXPECT_LE(row.at(0).gap, 1e-9);
  EXPECT_LE(row.at(0).energy_error.value(), 1e-8);
}

TEST(Simbody, ErrorControlledAgreesWithTheExactMotionUnderTorque) {
  SKIP_UNLESS_BUILT("simbody");
  const PeerMethod method = {"peer_simbody", "runge_kutta_merson", {{"accuracy", 1e-10}}};
  AccuracySpec spec = study(kTorque, method, {0.01});
  spec.methods[0].set = {"duration=1"};
  EXPECT_LE(rows(spec).at(0).rate_error, 1e-8);
}

// Merson's method is of order 4.
TEST(Simbody, RungeKuttaMersonIsOfFourthOrder) {
  SKIP_UNLESS_BUILT("simbody");
  const std::vector<AccuracyRow> row =
      rows(early(study(kIftomm, {"peer_simbody", "runge_kutta_merson", {}}, {5e-3, 1e-3})));
  EXPECT_GE(order(row.at(0), row.at(1)), 3.5);
}

// The constraint is soft, with a time constant of one step: between the orders of the spring (2) and the
// method (4).
TEST(Mujoco, RungeKuttaConvergesToTheExactMotionFasterThanFirstOrder) {
  SKIP_UNLESS_BUILT("mujoco");
  const std::vector<AccuracyRow> row = rows(early(study(kIftomm, {"peer_mujoco", "rk4", {}}, {2e-3, 5e-4})));
  EXPECT_GE(order(row.at(0), row.at(1)), 1.8);
  EXPECT_LE(row.at(1).early_rate_error, 2e-4);
}

/// A program in place of a peer.
AccuracySpec impostor(const fs::path& folder, const std::string& script) {
  const fs::path program = folder / "peer_impostor";
  std::ofstream(program) << "#!/bin/sh\n" << script << "\n";
  fs::permissions(program, fs::perms::owner_all);
  return study(kIftomm, {"peer_impostor", "euler", {}}, {1e-2}, folder);
}

std::string fault_of(const AccuracySpec& spec) {
  return run_accuracy(spec, nullptr).rows.at(0).fault.value_or("no fault");
}

TEST(PeerProtocol, RefusesAMechanismOfOtherMass) {
  SKIP_UNLESS_BUILT("mujoco");
  const test::TemporaryFolder folder;
  const std::string real = std::string(HANDSIM_PEERS_FOLDER) + "/peer_mujoco";
  EXPECT_EQ(fault_of(impostor(folder.path(), "exec '" + real + "'")), "no fault");
  EXPECT_NE(fault_of(impostor(folder.path(), "sed 's/\"mass\":2.0/\"mass\":2.001/' | '" + real + "'"))
                .find("the mechanisms differ"),
            std::string::npos);
}

TEST(PeerProtocol, RefusesAnotherStart) {
  SKIP_UNLESS_BUILT("mujoco");
  const test::TemporaryFolder folder;
  const std::string real = std::string(HANDSIM_PEERS_FOLDER) + "/peer_mujoco";
  const std::string fault = fault_of(
      impostor(folder.path(),
               "sed 's/\"position\":\\[0.0,0.1,0.16\\]/\"position\":[0.0,0.1,0.161]/' | '" + real + "'"));
  EXPECT_NE(fault.find("start state"), std::string::npos) << fault;
}

TEST(PeerProtocol, SaysWhyAProgramFailed) {
  const test::TemporaryFolder folder;
  EXPECT_NE(
      fault_of(impostor(folder.path(), "echo 'no such integrator' >&2; exit 3")).find("no such integrator"),
      std::string::npos);
  EXPECT_NE(fault_of(impostor(folder.path(), "kill -9 $$")).find("killed by signal 9"), std::string::npos);
  EXPECT_NE(fault_of(impostor(folder.path(), "echo hello")).find("not the first line of the protocol"),
            std::string::npos);
}

TEST(PeerProtocol, RefusesASettingThatTheMethodDoesNotHave) {
  SKIP_UNLESS_BUILT("simbody");
  const AccuracySpec spec =
      study(kIftomm, {"peer_simbody", "runge_kutta_merson", {{"acuracy", 1e-4}}}, {1e-2});
  EXPECT_NE(fault_of(spec).find("no setting acuracy"), std::string::npos);
}

TEST(PeerProtocol, SaysThatAProgramIsNotThere) {
  EXPECT_NE(fault_of(study(kIftomm, {"peer_nobody", "euler", {}}, {1e-2})).find("peer_nobody"),
            std::string::npos);
}

// Oracle: a row of a program and one of handsim, in one table; a program that is not there is named.
TEST(PeerAccuracy, AddsRowsOfOtherEnginesToAStudy) {
  SKIP_UNLESS_BUILT("mujoco");
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "study.yaml")
      << "scene: " << test::source(kIftomm.scene).string()
      << "\nreference: slider_crank_iftomm\nobserve: slide\nrepeats: 1\nsteps: [10 ms, 5 ms]\n"
         "methods: [{name: ours, set: {solver.engine: articulated}}]\n";
  std::ofstream(folder.path() / "peers.yaml")
      << "study: study.yaml\npeers:\n  - {name: theirs, program: peer_mujoco, method: euler}\n"
         "  - {name: nobody's, program: peer_nobody, method: euler, set: {accuracy: 1e-4}}\n";
  const std::string out = (folder.path() / "out").string();
  ASSERT_EQ(std::system((std::string(HANDSIM_PEERS_FOLDER) + "/peer_accuracy " +
                         (folder.path() / "peers.yaml").string() + " --out " + out + " >" + out + ".txt")
                            .c_str()),
            0);
  const std::string table = test::text_of(folder.path() / "out/accuracy.csv");
  for (const char* row : {"\"ours\",0.01", "\"ours\",0.005", "\"theirs\",0.01", "\"theirs\",0.005"})
    EXPECT_NE(table.find(row), std::string::npos) << table;
  EXPECT_NE(test::text_of(out + ".txt").find("left out: nobody's (there is no "), std::string::npos);
  EXPECT_NE(test::text_of(folder.path() / "out/accuracy.json").find("MuJoCo"), std::string::npos);
}

TEST(PeerProtocol, HasNoWordsForContact) {
  EXPECT_THROW(run_accuracy(study({"config/slider_crank_contact.yaml", Reference::smallest_step},
                                  {"sh", "euler", {}}, {1e-2}, "/bin"),
                            nullptr),
               Error);
}

}  // namespace
}  // namespace handsim::study
