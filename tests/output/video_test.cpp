// Videos, the threads that draw, and the two ways to OpenGL.
#include "handsim/output/video/video.h"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>

#include "handsim/core/error.h"
#include "handsim/output/child.h"
#include "handsim/output/render/renderer.h"
#include "render/scenes.h"
#include "scene_files.h"

namespace handsim::output {
namespace {

std::string output_of(const std::string& command) {
  std::FILE* pipe = popen(command.c_str(), "r");
  std::string out;
  char text[4096];
  for (std::size_t got = 0; pipe && (got = std::fread(text, 1, sizeof text, pipe)) > 0;)
    out.append(text, got);
  if (pipe) pclose(pipe);
  return out;
}

bool has_ffmpeg() { return std::system("ffmpeg -version >/dev/null 2>&1") == 0; }

/// A grey that tells the frame.
Image grey(int width, int height, int frame) {
  Image image{width, height, {}};
  image.rgb.assign(3UL * static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                   static_cast<std::uint8_t>(20 + 6 * frame));
  return image;
}

// Oracle: ffprobe's account of the file, and each frame's grey as ffmpeg decodes it (lossy: within 4 of 255).
TEST(Video, HasTheFramesThatItWasGivenInOrder) {
  if (!has_ffmpeg()) GTEST_SKIP() << "no program ffmpeg (Debian package ffmpeg)";
  const test::TemporaryFolder folder;
  for (const char* name : {"a.mp4", "a.gif"}) {
    const std::filesystem::path file = folder.path() / name;
    VideoWriter video({file, 65, 48, 25});
    for (int i = 0; i < 30; ++i) video.add(grey(65, 48, i));
    EXPECT_FALSE(std::filesystem::exists(file));
    video.finish();
    const std::string account = output_of(
        "ffprobe -v error -count_frames -show_entries stream=width,height,avg_frame_rate,nb_read_frames -of "
        "csv=p=0 " +
        file.string());
    EXPECT_EQ(account, std::string(name) == "a.mp4" ? "66,48,25/1,30\n" : "65,48,25/1,30\n");
    const std::string pixels = output_of("ffmpeg -v error -i " + file.string() +
                                         " -vf format=gray,crop=1:1:20:20 -f rawvideo -pix_fmt gray -");
    ASSERT_EQ(pixels.size(), 30U);
    for (int i = 0; i < 30; ++i)
      EXPECT_NEAR(static_cast<unsigned char>(pixels[static_cast<std::size_t>(i)]), 20 + 6 * i, 4) << name;
  }
}

TEST(Video, RefusesWhatItCannotWrite) {
  const test::TemporaryFolder folder;
  for (const char* name : {"a.avi", "a", "a.mp4.png"})
    EXPECT_THROW(check_video(folder.path() / name, 30), Error) << name;
  EXPECT_THROW(check_video(folder.path() / "a.gif", 60), Error);
  EXPECT_THROW(check_video(folder.path() / "a.mp4", 0), Error);
  if (!has_ffmpeg()) GTEST_SKIP() << "no program ffmpeg (Debian package ffmpeg)";
  EXPECT_NO_THROW(check_video(folder.path() / "a.MP4", 60));
  {
    VideoWriter video({folder.path() / "a.mp4", 64, 48, 25});
    EXPECT_THROW(video.add(grey(48, 64, 0)), Error);
  }
  // Neither the video nor a temporary file of one that was not finished.
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

// Oracle: what one thread gives. Five deliver in order also if the first of each round is the slowest.
TEST(Workers, PassPicturesOnInOrder) {
  const auto maker = [] {
    return [](std::size_t i) {
      if (i % 5 == 0) usleep(20'000);
      return grey(20, 10, static_cast<int>(i));
    };
  };
  for (const int threads : {1, 5, 50}) {
    std::size_t next = 0;
    make_in_order(23, threads, maker, [&](std::size_t i, Image&& image) {
      EXPECT_EQ(i, next++);
      EXPECT_EQ(image.rgb, grey(20, 10, static_cast<int>(i)).rgb);
    });
    EXPECT_EQ(next, 23U);
  }
}

std::string failure_of(const MakeImage& make) {
  const auto job = [&](const Progress&) {
    make_in_order(
        8, 2, [&] { return make; }, [](std::size_t, Image&&) {});
  };
  return run_in_child(job, {}).value_or("none");
}

TEST(Workers, ReportWhatTheyDiedOf) {
  EXPECT_NE(failure_of([](std::size_t i) {
              if (i == 3) throw input_error("picture", "a third one", "two");
              return grey(20, 10, 0);
            }).find("a third one"),
            std::string::npos);
  EXPECT_NE(failure_of([](std::size_t i) {
              if (i == 3) raise(SIGKILL);
              return grey(20, 10, 0);
            }).find("signal 9"),
            std::string::npos);
}

// Oracle: both are Mesa's drawing by the processor, so they differ by rounding alone.
TEST(Canvas, OsmesaAndEglDrawTheSamePicture) {
  if (built_gls().size() < 2) GTEST_SKIP() << "a build with one of OSMesa and EGL";
  const model::Model model = hand_model(model::Side::right, {});
  DrawList list = draw_list(model, at_zero(model), {});
  list.ground_height = -0.05;
  list.arrows.push_back({{0, 0, 0}, {0, 0.1, 0.1}, 0.002, {0.7F, 0, 0.3F}, true});
  const Camera camera = framed_camera(View::three_quarter, {}, model::Side::right, list, 640.0 / 480);
  const Image osmesa = Renderer(640, 480, Gl::osmesa).draw(list, camera);
  const Image egl = Renderer(640, 480, Gl::egl).draw(list, camera);
  ASSERT_EQ(osmesa.rgb.size(), egl.rgb.size());
  int most = 0;
  for (std::size_t i = 0; i < egl.rgb.size(); ++i)
    most = std::max(most, std::abs(int{osmesa.rgb[i]} - int{egl.rgb[i]}));
  EXPECT_LE(most, 1);
  // The picture has a hand in it: not all pixels are alike.
  EXPECT_GT(share_differing(egl, grey(640, 480, 30), 20), 0.05);
}

}  // namespace
}  // namespace handsim::output
