#include "handsim/scene/read/mesh_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"

namespace handsim::scene {

namespace {

constexpr std::size_t kMostBytes = 64U << 20U;
constexpr std::size_t kMostFaces = 100'000;
constexpr std::size_t kMostPoints = 3 * kMostFaces;
constexpr const char* kNeed = "an OBJ or STL file";

/// Statements of OBJ that do not describe the surface.
constexpr std::array<std::string_view, 19> kNoSurface = {
    "vt",     "vn",  "vp", "g", "o",     "s",        "mg",       "usemtl",     "mtllib",   "usemap",
    "maplib", "lod", "l",  "p", "bevel", "c_interp", "d_interp", "shadow_obj", "trace_obj"};

struct Word {
  std::string_view text;
  int column = 1;
};

/// The words of a text, line by line, with their places.
class Lines {
 public:
  Lines(std::string_view text, std::string name) : rest_(text), name_(std::move(name)) {}

  bool next() {
    if (rest_.empty()) return false;
    line_ = take_line(rest_);
    ++number_;
    at_ = 0;
    return true;
  }
  std::optional<Word> word() {
    constexpr std::string_view kBlank = " \t\r\v\f";
    const std::size_t begin = line_.find_first_not_of(kBlank, at_);
    if (begin == std::string_view::npos) return std::nullopt;
    at_ = std::min(line_.find_first_of(kBlank, begin), line_.size());
    return Word{line_.substr(begin, at_ - begin), static_cast<int>(begin) + 1};
  }
  Vec3 point() {
    Vec3 out;
    for (int i = 0; i < 3; ++i) {
      const std::optional<Word> text = word();
      const auto value = text ? parse_number(text->text) : std::nullopt;
      if (!value)
        refuse(text ? text->column : 1, text ? quoted(text->text) : "too few coordinates",
               "three finite coordinates");
      out[i] = *value;
    }
    return out;
  }
  static std::string quoted(std::string_view text) { return "\"" + printable(text) + "\""; }
  [[noreturn]] void refuse(int column, std::string got, std::string need) const {
    throw Error(std::vector<Problem>{
        {Place{name_, std::max(1, number_), column}, "", std::move(got), std::move(need)}});
  }

 private:
  std::string_view rest_, line_;
  std::size_t at_ = 0;
  int number_ = 0;
  std::string name_;
};

/// Builds a surface while it is read; refuses too many points or triangles, with the line.
class Builder {
 public:
  explicit Builder(const Lines& lines) : lines_(lines) {}

  void add_point(const Vec3& point) {
    if (surface_.vertices.size() == kMostPoints)
      lines_.refuse(1, fmt::format("more than {} points", kMostPoints), "fewer: a simpler mesh");
    surface_.vertices.push_back(point);
  }
  void add_corner(int point) {
    if (face_.size() >= 2 && ++triangles_ > kMostFaces)
      lines_.refuse(1, fmt::format("more than {} triangles", kMostFaces), "fewer: a simpler mesh");
    face_.push_back(point);
  }
  void end_face() { surface_.faces.push_back(std::exchange(face_, {})); }
  int points() const { return static_cast<int>(surface_.vertices.size()); }
  std::size_t open_corners() const { return face_.size(); }
  Surface take() { return std::move(surface_); }

 private:
  const Lines& lines_;
  Surface surface_;
  std::vector<int> face_;  ///< the current one
  std::size_t triangles_ = 0;
};

/// `7`, `7/1`, `7//2`, `7/1/2`, or `-1` for the last point so far.
int point_index(const Lines& lines, const Word& word, int points) {
  const double index = parse_number(word.text.substr(0, word.text.find('/'))).value_or(0);
  const double at = index < 0 ? index + points : index - 1;
  if (index == 0 || index != std::floor(index) || !(at >= 0 && at < points))
    lines.refuse(
        word.column, Lines::quoted(word.text),
        fmt::format("the index of one of the {} points above, from 1, or from the last backwards, from -1",
                    points));
  return static_cast<int>(at);
}

Surface read_obj(std::string_view text, const std::string& name) {
  Lines lines(text, name);
  Builder surface(lines);
  while (lines.next()) {
    const std::optional<Word> key = lines.word();
    if (!key || key->text.front() == '#') continue;
    if (key->text == "v") {
      surface.add_point(lines.point());
    } else if (key->text == "f") {
      while (const std::optional<Word> corner = lines.word()) {
        if (corner->text.front() == '#') break;
        surface.add_corner(point_index(lines, *corner, surface.points()));
      }
      if (surface.open_corners() < 3)
        lines.refuse(1, fmt::format("a face of {} corners", surface.open_corners()), "at least 3");
      surface.end_face();
    } else if (std::ranges::find(kNoSurface, key->text) == kNoSurface.end()) {
      lines.refuse(key->column, Lines::quoted(key->text), "a statement of OBJ such as v or f");
    }
  }
  return surface.take();
}

std::uint32_t word_at(std::string_view bytes, std::size_t at) {
  std::uint32_t out = 0;
  for (std::size_t i = 4; i-- > 0;) out = out << 8U | static_cast<unsigned char>(bytes[at + i]);
  return out;
}

constexpr std::size_t kStlHead = 84, kStlTriangle = 50;

Surface read_binary_stl(std::string_view bytes, const std::string& name) {
  const Lines no_lines({}, name);
  Builder surface(no_lines);
  for (std::size_t at = kStlHead; at < bytes.size(); at += kStlTriangle) {
    // The normal, which comes first, follows from the corners.
    for (std::size_t corner = 1; corner <= 3; ++corner) {
      Vec3 point;
      for (std::size_t i = 0; i < 3; ++i)
        point[static_cast<int>(i)] = std::bit_cast<float>(word_at(bytes, at + 12 * corner + 4 * i));
      if (!point.allFinite())
        no_lines.refuse(
            1, fmt::format("a corner of triangle {} that is not finite", (at - kStlHead) / kStlTriangle + 1),
            "three finite coordinates");
      surface.add_point(point);
      surface.add_corner(surface.points() - 1);
    }
    surface.end_face();
  }
  return surface.take();
}

enum class Within { file, solid, facet, loop, end_of_facet };

struct Statement {
  std::string_view word;
  Within from, to;
};
constexpr std::array<Statement, 7> kStatements = {{{"solid", Within::file, Within::solid},
                                                   {"facet", Within::solid, Within::facet},
                                                   {"endsolid", Within::solid, Within::file},
                                                   {"outer", Within::facet, Within::loop},
                                                   {"vertex", Within::loop, Within::loop},
                                                   {"endloop", Within::loop, Within::end_of_facet},
                                                   {"endfacet", Within::end_of_facet, Within::solid}}};

/// The statements that are allowed in a state.
std::string words_of(Within place) {
  std::string out;
  for (const Statement& statement : kStatements)
    if (statement.from == place) out += (out.empty() ? "" : " or ") + std::string(statement.word);
  return out;
}

Surface read_text_stl(std::string_view text, const std::string& name) {
  Lines lines(text, name);
  Builder surface(lines);
  Within place = Within::file;
  while (lines.next()) {
    const std::optional<Word> word = lines.word();
    if (!word) continue;
    const std::string key = lower_case(word->text);
    const auto found = std::ranges::find_if(kStatements, [&](const Statement& statement) {
      return statement.word == key && statement.from == place;
    });
    if (found == kStatements.end()) lines.refuse(word->column, Lines::quoted(word->text), words_of(place));
    if (place == Within::loop && (surface.open_corners() == 3) != (key == "endloop"))
      lines.refuse(word->column, fmt::format("\"{}\" after {} corners", key, surface.open_corners()),
                   "three corners in each facet");
    place = found->to;
    if (key == "endfacet") surface.end_face();
    if (key != "vertex") continue;
    surface.add_point(lines.point());
    surface.add_corner(surface.points() - 1);
  }
  if (place != Within::file) lines.refuse(1, "a file that ends before endsolid", "a complete STL file");
  return surface.take();
}

Surface read_stl(std::string_view bytes, const std::string& name) {
  // A binary file may also begin with `solid`.
  const std::size_t stated = bytes.size() >= kStlHead ? word_at(bytes, kStlHead - 4) : 0;
  if (bytes.size() >= kStlHead && bytes.size() == kStlHead + kStlTriangle * stated)
    return read_binary_stl(bytes, name);
  const std::size_t first = bytes.find_first_not_of(" \t\r\n");
  if (lower_case(bytes.substr(std::min(first, bytes.size()), 5)) == "solid")
    return read_text_stl(bytes, name);
  Lines({}, name).refuse(1, fmt::format("{} bytes, which do not begin with solid", bytes.size()),
                         bytes.size() < kStlHead
                             ? std::string("an STL file in text or binary")
                             : fmt::format("{} bytes for its {} triangles in binary, or STL in text",
                                           kStlHead + kStlTriangle * stated, stated));
}

}  // namespace

Surface read_surface_file(const std::filesystem::path& path) {
  // Binary STL files are not text; those in text that begin with a mark are refused by their first word.
  if (lower_case(path.extension().string()) == ".stl")
    return read_stl(read_input_file(path, kNeed, kMostBytes), path.string());
  return read_obj(read_text_file(path, kNeed, kMostBytes), path.string());
}

}  // namespace handsim::scene
