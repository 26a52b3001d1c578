// The page of a run, read back. Oracles: the tables of the run, and the model's kinematics.
#include "handsim/simulation/report/run_report.h"

#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "handsim/core/error.h"
#include "handsim/output/report/page.h"
#include "handsim/output/table/table_files.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/simulation/run/run.h"
#include "places.h"

namespace handsim::simulation {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class RunReport : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = fs::temp_directory_path() / ("handsim_run_report_" + std::to_string(::getpid()));
    RunOptions options;
    options.out = folder;
    run(scene::load_scene(fs::path(test::in_source("config/two_hands.yaml")), {"duration=0.3 s"}), options);
  }
  static void TearDownTestSuite() { fs::remove_all(folder); }
  void SetUp() override {
    if (!output::has_three()) GTEST_SKIP() << "a build without three.js";
  }

  static json data_of(const std::string& page) {
    const std::string open = "id=\"data\">";
    const std::size_t at = page.find(open) + open.size();
    return json::parse(page.substr(at, page.find("</script>", at) - at));
  }
  /// Bytes of base64 as floats.
  static std::vector<float> floats(const std::string& text) {
    std::vector<unsigned char> bytes;
    unsigned word = 0;
    int bits = 0;
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (const char c : text) {
      if (c == '=') break;
      word = word << 6U | static_cast<unsigned>(digits.find(c));
      bits += 6;
      if (bits < 8) continue;
      bits -= 8;
      bytes.push_back(static_cast<unsigned char>(word >> static_cast<unsigned>(bits) & 255U));
    }
    std::vector<float> out(bytes.size() / sizeof(float));
    std::memcpy(out.data(), bytes.data(), out.size() * sizeof(float));
    return out;
  }

  static fs::path folder;
};
fs::path RunReport::folder;

TEST_F(RunReport, HasThePosesOfTheTrajectory) {
  const json poses = data_of(run_report({folder}))["runs"][0]["poses"];
  const output::NumberTable table = output::read_numbers(folder / "trajectory.csv");
  const std::vector<float> times = floats(poses["times"]), values = floats(poses["values"]);
  const std::size_t width = 7 * poses["moving"].size();
  ASSERT_EQ(values.size(), times.size() * width);
  EXPECT_EQ(poses["recorded"], table.rows());
  const scene::Scene scene = scene::load_scene(folder / "resolved.yaml");
  const std::size_t last = table.rows() - 1;
  for (std::size_t i = 0; i < poses["moving"].size(); ++i) {
    const std::string name = scene.model.bodies[poses["moving"][i]].name;
    const auto column = std::find(table.columns.begin(), table.columns.end(), name + ".x[m]");
    ASSERT_NE(column, table.columns.end()) << name;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto c = static_cast<std::size_t>(column - table.columns.begin()) + k;
      EXPECT_FLOAT_EQ(values[7 * i + k], static_cast<float>(table.at(0, c))) << name;
      EXPECT_FLOAT_EQ(values[values.size() - width + 7 * i + k], static_cast<float>(table.at(last, c)))
          << name;
    }
  }
}

TEST_F(RunReport, HasEveryShapeOfTheSceneAndTheCommandThatRepeatsIt) {
  const json run = data_of(run_report({folder}))["runs"][0];
  const scene::Scene scene = scene::load_scene(folder / "resolved.yaml");
  // Nails and wrist stumps are marks beside the model's shapes.
  std::size_t shapes = 0;
  for (const json& shape : run["scene"]["shapes"]) shapes += shape.contains("mark") ? 0 : 1;
  EXPECT_EQ(shapes, scene.model.shapes.size());
  EXPECT_EQ(run["scene"]["tips"].size(), 10U);
  const std::string hash = run["summary"]["state_hash"];
  EXPECT_NE(run["command"].get<std::string>().find("--expect-hash " + hash), std::string::npos);
  EXPECT_NE(run["resolved"].get<std::string>().find("duration"), std::string::npos);
}

TEST_F(RunReport, OfTwoRunsHasBoth) { EXPECT_EQ(data_of(run_report({folder, folder}))["runs"].size(), 2U); }

TEST_F(RunReport, IsRefusedForTablesOfAnotherScene) {
  const fs::path other = folder.string() + "_other";
  fs::create_directories(other);
  for (const char* name : {"resolved.yaml", "summary.json"}) fs::copy_file(folder / name, other / name);
  EXPECT_THROW(run_report({other}), Error);
  std::ofstream(other / "trajectory.csv") << "time[s],a\n0,1\n";
  EXPECT_THROW(run_report({other}), Error);
  fs::remove_all(other);
}

// Oracle: muscles.sto, and the anatomy: the deep flexor of the index moves the index.
TEST_F(RunReport, HasActivationsAndTensionsOfMusclesByFinger) {
  const fs::path out = folder.string() + "_muscles";
  RunOptions options;
  options.out = out;
  run(scene::load_scene(fs::path(test::in_source("config/muscle_poses.yaml")), {"duration=0.1 s"}), options);
  const json page = data_of(run_report({out}))["runs"][0];
  const output::NumberTable table = output::read_numbers(out / "muscles.sto");
  const auto last = [&](const std::string& name) {
    const auto column = std::find(table.columns.begin(), table.columns.end(), name) - table.columns.begin();
    return static_cast<float>(table.at(table.rows() - 1, static_cast<std::size_t>(column)));
  };
  int found = 0;
  for (const json& curve : page["curves"]) {
    const std::string group = curve["group"], name = curve["name"];
    EXPECT_NE(group, "Torques");
    // Axes are named flexion and abduction.
    if (group == "Angles") {
      EXPECT_TRUE(name.ends_with("flexion") || name.ends_with("abduction")) << name;
    }
    if (name != "right.FDP2") continue;
    ++found;
    const bool tension = group == "Tensions, index";
    EXPECT_TRUE(tension || group == "Activations, index") << group;
    EXPECT_EQ(curve["unit"], tension ? "N" : "");
    EXPECT_FLOAT_EQ(floats(curve["values"]).back(), last(name + (tension ? ".tendon[N]" : ".activation[]")));
  }
  EXPECT_EQ(found, 2);
  // The wrist is fixed in this scene.
  EXPECT_EQ(page["zero"].dump(), R"(["Activations, wrist","Joint gaps","Tensions, wrist","Torques"])");
  fs::remove_all(out);
}

TEST_F(RunReport, IsRefusedForTablesThatWereChanged) {
  const fs::path other = folder.string() + "_changed", table = other / "trajectory.csv";
  fs::copy(folder, other);
  std::ifstream file(table);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::size_t second = text.find('\n', text.find('\n') + 1) + 1;
  const auto said = [&](const std::string& changed) -> std::string {
    std::ofstream(table) << changed;
    try {
      run_report({other});
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(said(text), "");
  EXPECT_NE(said(text.substr(0, text.size() - 1)).find("a line without its end"), std::string::npos);
  EXPECT_NE(said(text + text.substr(second)).find("need times that increase"), std::string::npos);
  std::string row = text.substr(second, text.find('\n', second) - second),
              rest = text.substr(second + row.size());
  EXPECT_NE(
      said(text.substr(0, second) + row.substr(0, row.rfind(',')) + ",nan" + rest).find(":3:1: got nan"),
      std::string::npos);
  EXPECT_NE(said(text.substr(0, second) + row.substr(0, row.rfind(',')) + ",5" + rest)
                .find("need a unit quaternion"),
            std::string::npos);
  fs::remove_all(other);
}

TEST(Tables, ReportTheLineOfAFieldThatIsNoNumber) {
  const fs::path path = fs::temp_directory_path() / ("handsim_table_" + std::to_string(::getpid()) + ".csv");
  std::ofstream(path) << "a,b\n1,2\n3,x\n";
  try {
    output::read_numbers(path);
    ADD_FAILURE() << "read";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(":3:"), std::string::npos) << error.what();
  }
  fs::remove(path);
}

// Oracle: RFC 4180: commas stand in quotes, quotes are doubled.
TEST(Tables, HaveQuotedFields) {
  const fs::path path = fs::temp_directory_path() / ("handsim_quoted_" + std::to_string(::getpid()) + ".csv");
  std::ofstream(path) << "a,b,c\n\"x, y\",,\"say \"\"no\"\"\"\n";
  std::vector<std::string> found;
  output::read_rows(path, [&](std::size_t, std::span<const std::string_view> fields) {
    found.assign(fields.begin(), fields.end());
  });
  EXPECT_EQ(found, (std::vector<std::string>{"x, y", "", "say \"no\""}));
  fs::remove(path);
}

}  // namespace
}  // namespace handsim::simulation
