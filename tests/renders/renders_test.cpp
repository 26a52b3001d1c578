// The README's pictures are what the program draws today.
#include <gtest/gtest.h>

#include <cstdlib>

#include <fmt/format.h>

#include "scene_files.h"
#include "support/read_png.h"
#include "support/sanitized.h"

namespace handsim {
namespace {

/// How two pictures differ: a renderer of another build moves edges by a fraction of a pixel, a wrong picture
/// moves whole shapes.
struct Difference {
  double mean = 0;   ///< of all components, 0..255
  double share = 0;  ///< of components that differ by more than 48
  bool same_size = true;
};

Difference compare(const output::Image& a, const output::Image& b) {
  Difference out;
  out.same_size = a.width == b.width && a.height == b.height;
  if (!out.same_size) return out;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) {
    const int difference = std::abs(int{a.rgb[i]} - int{b.rgb[i]});
    out.mean += difference;
    out.share += difference > 48 ? 1 : 0;
  }
  out.mean /= static_cast<double>(a.rgb.size());
  out.share /= static_cast<double>(a.rgb.size());
  return out;
}

bool alike(const Difference& difference) {
  return difference.same_size && difference.mean < 0.5 && difference.share < 0.002;
}

/// A picture in renders/ and the command that makes it; OUT stands for a folder.
struct Render {
  const char* picture;
  const char* command;
  const char* made;
};
void PrintTo(const Render& render, std::ostream* out) { *out << render.picture; }

/// The shell command that runs the program with these arguments in the checkout.
std::string program(const std::string& arguments) {
  return fmt::format("cd {} && {} {}", test::kSourceFolder, test::kProgramFile, arguments);
}

class Renders : public ::testing::TestWithParam<Render> {};
constexpr Render kRenders[] = {
    {"two_hands.png", "run config/two_hands.yaml --out OUT --frames 8", "contact_sheet.png"},
    {"two_hands_contact.png", "run config/two_hands_contact.yaml --out OUT --poses", "contact_sheet.png"},
    {"poses.png", "run config/every_pose.yaml --out OUT --poses --set 'pictures.size=[400, 256]'",
     "contact_sheet.png"},
    {"hands.png", "hand --stature 1.75 --mass 72 --sex male --out OUT", "hand.png"},
    {"objects.png", "render config/object_collection.yaml --time 1 --out OUT/p.png", "p.png"},
    {"dropped_hand.png", "render config/dropped_hand.yaml --time 0.5 --out OUT/p.png", "p.png"},
    {"climb_half_crimp.png", "run config/climb_half_crimp.yaml --out OUT --poses", "contact_sheet.png"},
    {"climb_jug.png", "run config/climb_jug.yaml --out OUT --poses", "contact_sheet.png"},
};
/// Title and captions of a page of pictures, from the description in its file.
std::string captions(const std::filesystem::path& file) {
  const std::string bytes = test::text_of(file), mark = std::string("Description") + std::string(5, '\0');
  const std::size_t at = bytes.find(mark);
  if (at == std::string::npos) return "";
  std::size_t size = 0;
  for (std::size_t i = at - 8; i < at - 4; ++i) size = 256 * size + static_cast<unsigned char>(bytes[i]);
  return bytes.substr(at + mark.size(), size - mark.size());
}

INSTANTIATE_TEST_SUITE_P(, Renders, ::testing::ValuesIn(kRenders));

TEST_P(Renders, AreWhatTheProgramDraws) {
  if (GetParam().picture != std::string("two_hands.png"))
    HANDSIM_SKIP_WITH_SANITIZER("a contact sheet shows all that is drawn");
  const test::TemporaryFolder folder;
  std::string command = GetParam().command;
  command.replace(command.find("OUT"), 3, folder.path().string());
  ASSERT_EQ(std::system((program(command) + " >/dev/null").c_str()), 0);
  const output::Image made = test::read_png(folder.path() / GetParam().made);
  const output::Image kept = test::read_png(test::source("renders") / GetParam().picture);
  const Difference difference = compare(made, kept);
  EXPECT_TRUE(alike(difference)) << "mean " << difference.mean << ", share " << difference.share;
  // A figure in a caption is too few pixels for this comparison.
  const bool sheet = GetParam().made == std::string("contact_sheet.png");
  EXPECT_NE(captions(folder.path() / GetParam().made).empty(), sheet);
  EXPECT_EQ(captions(test::source("renders") / GetParam().picture),
            captions(folder.path() / GetParam().made));
}

// The comparison can fail: the same hands a little later are another picture.
TEST(Compare, TellsMomentsApart) {
  const test::TemporaryFolder folder;
  const std::string later =
      "render config/dropped_hand.yaml --time 0.45 --out " + (folder.path() / "p.png").string();
  ASSERT_EQ(std::system(program(later).c_str()), 0);
  EXPECT_FALSE(alike(compare(test::read_png(folder.path() / "p.png"),
                             test::read_png(test::source("renders/dropped_hand.png")))));
}

}  // namespace
}  // namespace handsim
