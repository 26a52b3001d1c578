// Surfaces: what Material::fields lists is what files state, what a model checks, and what docs/scenes.md
// says.
#include <gtest/gtest.h>

#include <cstdlib>

#include <fmt/format.h>

#include "scene_files.h"

namespace handsim::scene {
namespace {

using model::Material;

Scene object_with(const std::string& surface) {
  return compile_scene(
      parse_yaml("objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0.2], " +
                     surface + "}]\nground: {}\nduration: 1\n",
                 "ball.yaml"));
}

/// What a key needs beside it: a pad has a stiffness.
std::string beside(std::string_view key) { return key == "damping" ? "stiffness: 100, " : ""; }

// Oracle: the value that the file states.
TEST(Surface, EveryKeyReachesTheModel) {
  Material::fields([](std::string_view key, auto member, const Quantity& range, auto...) {
    const double value = range.min + 0.25 * (range.max - range.min);
    const Scene scene = object_with(fmt::format("{}{}: {}", beside(key), key, value));
    const model::Shape& shape =
        scene.model.shapes[static_cast<std::size_t>(scene.model.objects[0].shapes[0])];
    const Material& surface = scene.model.materials[static_cast<std::size_t>(shape.material)];
    const std::optional<double> read = field_value(surface, member);
    ASSERT_TRUE(read) << key;
    EXPECT_EQ(*read, value) << key;
  });
}

// Oracle: the range of the list, at the key's place in the file.
TEST(Surface, EveryKeyIsRefusedOutsideOfItsRange) {
  Material::fields([](std::string_view key, auto, const Quantity& range, auto...) {
    try {
      object_with(fmt::format("{}{}: {}", beside(key), key, 1.01 * range.max));
      ADD_FAILURE() << key;
    } catch (const Error& error) {
      ASSERT_EQ(error.problems().size(), 1U) << error.what();
      EXPECT_EQ(error.problems()[0].key, fmt::format("objects.0.{}", key));
    }
  });
}

// Oracle: the table of the page, `| `key` | default unit | least to most unit | meaning |`.
TEST(Surface, ThePageStatesEveryKeyWithItsDefaultAndRange) {
  const std::string page = test::text_of(test::source("docs/scenes.md"));
  Material::fields([&](std::string_view key, auto member, const Quantity& range, auto...) {
    const std::size_t row =
        page.find(fmt::format("\n| `{}` | ", key), page.find("<!-- keys: scene; object; material"));
    ASSERT_NE(row, std::string::npos) << key;
    const std::size_t first = page.find(" | ", row) + 3, second = page.find(" | ", first) + 3;
    const std::optional<double> usual = field_value(Material(), member);
    if (usual) {
      EXPECT_EQ(std::strtod(page.c_str() + first, nullptr), *usual) << key;
    }
    char* end = nullptr;
    EXPECT_EQ(std::strtod(page.c_str() + second, &end), range.min) << key;
    ASSERT_EQ(std::string_view(end, 4), " to ") << key;
    EXPECT_EQ(std::strtod(end + 4, nullptr), range.max) << key;
  });
}

}  // namespace
}  // namespace handsim::scene
