#include "handsim/output/table/gnuplot.h"

#include <algorithm>
#include <fstream>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/output/atomic_file.h"
#include "handsim/output/child.h"

namespace handsim::output {

namespace {

namespace fs = std::filesystem;

/// True if a PNG or SVG file is complete: gnuplot does not report files that it could not complete.
bool is_complete(const fs::path& path) {
  constexpr std::string_view kPngEnd("IEND\xae\x42\x60\x82", 8), kSvgEnd = "</svg>";
  const std::string_view end = path.extension() == ".png" ? kPngEnd : kSvgEnd;
  constexpr std::streamoff kTail = 64;
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = file.tellg();
  if (!file || size < static_cast<std::streamoff>(end.size())) return false;
  std::string tail(static_cast<std::size_t>(std::min(size, kTail)), '\0');
  file.seekg(-static_cast<std::streamoff>(tail.size()), std::ios::end);
  file.read(tail.data(), static_cast<std::streamsize>(tail.size()));
  while (!tail.empty() && (tail.back() == '\n' || tail.back() == '\r')) tail.pop_back();
  return file && std::string_view(tail).ends_with(end);
}

}  // namespace

bool has_gnuplot() { return wait_for(start_program({"gnuplot", "-e", "exit"})) == 0; }

bool plot(const std::string& script, const fs::path& folder, const std::vector<std::string>& outputs) {
  const std::string head = part_name() + ".";
  const auto part = [&](const std::string& name) { return folder / (head + name); };
  bool good = wait_for(start_program({"gnuplot", "-e", fmt::format("part='{}'", head), script}, folder)) == 0;
  for (const std::string& name : outputs) good = good && is_complete(part(name));
  std::error_code failure, ignored;
  for (const std::string& name : outputs) {
    if (good) fs::rename(part(name), folder / name, failure);
    good = good && !failure;
    if (!good) fs::remove(part(name), ignored);
  }
  return good;
}

std::string plot_text(std::string text) {
  for (char& c : text)
    if (c == '\'' || c == '`' || c == '"' || c == '\\' || static_cast<unsigned char>(c) < ' ') c = ' ';
  return text;
}

std::vector<Panel> hand_panels(
    const std::vector<std::string>& names,
    const std::function<std::string(std::size_t index, const char* colour)>& curve) {
  constexpr const char* kColours[] = {"#1b6ca8", "#c8553d", "#3a7d44", "#8e5ea2", "#b8860b"};
  std::vector<Panel> out;
  for (const char* part : {"wrist", "thumb", "index", "middle", "ring", "little"}) {
    std::vector<std::string> curves;
    for (std::size_t i = 0; i < names.size(); ++i)
      if (names[i].starts_with(part))
        curves.push_back(curve(i, kColours[curves.size() % std::size(kColours)]));
    if (!curves.empty()) out.push_back({part, fmt::format("plot {}\n", fmt::join(curves, ", "))});
  }
  return out;
}

}  // namespace handsim::output
