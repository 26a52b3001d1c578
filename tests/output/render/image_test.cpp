#include "handsim/output/render/image.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "handsim/core/error.h"
#include "handsim/output/render/contact_sheet.h"
#include "support/read_png.h"

namespace handsim::output {
namespace {

namespace fs = std::filesystem;

/// A temporary folder.
class ImageTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder = fs::temp_directory_path() / ("handsim_image_" + std::to_string(::getpid()) + "_" +
                                          ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder);
  }
  void TearDown() override { fs::remove_all(folder); }
  fs::path folder;
};

Image pattern(int width, int height) {
  Image image{width, height, {}};
  for (int i = 0; i < 3 * width * height; ++i) image.rgb.push_back(static_cast<std::uint8_t>(i * 7919 % 256));
  return image;
}

// Oracle: bit equality.
TEST_F(ImageTest, PngRoundTripIsExact) {
  const Image image = pattern(37, 23);
  write_png(image, folder / "a.png");
  const Image back = test::read_png(folder / "a.png");
  EXPECT_EQ(back.width, 37);
  EXPECT_EQ(back.height, 23);
  EXPECT_EQ(back.rgb, image.rgb);
}

TEST_F(ImageTest, OnlyTheFinishedFileIsLeft) {
  write_png(pattern(4, 4), folder / "a.png");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 1);
}

TEST_F(ImageTest, UnwritablePathIsAnErrorAndLeavesNoFile) {
  EXPECT_THROW(write_png(pattern(4, 4), folder / "missing" / "a.png"), Error);
  fs::create_directory(folder / "a.png");
  EXPECT_THROW(write_png(pattern(4, 4), folder / "a.png"), Error);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 1);
  EXPECT_TRUE(fs::is_empty(folder / "a.png"));
}

TEST_F(ImageTest, ImageWithTooFewBytesIsAnError) {
  Image image = pattern(4, 4);
  image.rgb.pop_back();
  EXPECT_THROW(write_png(image, folder / "a.png"), Error);
  EXPECT_TRUE(fs::is_empty(folder));
}

Image plain(int width, int height, std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  Image image{width, height, {}};
  for (int i = 0; i < width * height; ++i) image.rgb.insert(image.rgb.end(), {r, g, b});
  return image;
}

/// Pixels of exactly this colour.
int count(const Image& image, std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  int n = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const std::uint8_t* p = image.pixel(x, y);
      n += p[0] == r && p[1] == g && p[2] == b;
    }
  return n;
}

/// All pictures on one sheet, of the first one's size.
Image sheet_of(const std::vector<Image>& images, const std::string& caption, const std::string& title,
               int width) {
  ContactSheet sheet(
      {static_cast<int>(images.size()), images.front().width, images.front().height, title, width});
  for (const Image& image : images) sheet.add(image, caption);
  return sheet.image();
}

// Oracle: pictures that fit are not scaled, so each keeps all its pixels.
TEST(ContactSheet, HoldsEveryPicture) {
  const Image sheet = sheet_of({plain(50, 40, 200, 10, 20), plain(50, 40, 10, 20, 200)}, "one", "", 800);
  EXPECT_EQ(count(sheet, 200, 10, 20), 50 * 40);
  EXPECT_EQ(count(sheet, 10, 20, 200), 50 * 40);
}

TEST(ContactSheet, ShrinksPicturesToTheWidth) {
  const std::vector<Image> images(8, plain(640, 480, 90, 90, 200));
  const Image sheet = sheet_of(images, "t = 0.25 s", "Eight", 1000);
  EXPECT_LE(sheet.width, 1000);
  EXPECT_GE(sheet.width, 980);
  // Two rows of four, each at most a quarter as wide.
  EXPECT_LT(sheet.height, 2 * 480);
}

// Oracle: the same sheet with and without text differs only in dark pixels on white.
TEST(ContactSheet, WritesCaptionAndTitle) {
  const std::vector<Image> white = {plain(200, 100, 255, 255, 255)};
  const auto ink = [](const Image& image) {
    return image.width * image.height - count(image, 255, 255, 255);
  };
  EXPECT_EQ(ink(sheet_of(white, "", "", 800)), 0);
  EXPECT_GT(ink(sheet_of(white, "caption", "", 800)), 50);
  EXPECT_GT(ink(sheet_of(white, "", "Title", 800)), 50);
}

TEST(ContactSheet, RefusesNoPicturesMixedSizesAndOneTooMany) {
  EXPECT_THROW(ContactSheet({0, 50, 40, "none"}), Error);
  ContactSheet sheet({1, 50, 40, ""});
  EXPECT_THROW(sheet.add(plain(40, 50, 0, 0, 0), ""), Error);
  sheet.add(plain(50, 40, 0, 0, 0), "");
  EXPECT_THROW(sheet.add(plain(50, 40, 0, 0, 0), ""), Error);
}

}  // namespace
}  // namespace handsim::output
