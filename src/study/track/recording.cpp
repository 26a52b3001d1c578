#include "handsim/study/track/recording.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "handsim/core/error.h"
#include "handsim/core/input_file.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"
#include "handsim/study/track/hand_tree.h"

namespace handsim::study {

namespace {

constexpr std::size_t kRecordingBytes = 512U << 20U;
constexpr std::size_t kMostFrames = 1'000'000;

std::string_view bare(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::vector<std::string_view> parts_of(std::string_view line, char separator) {
  std::vector<std::string_view> out;
  while (true) {
    const std::size_t end = line.find(separator);
    out.push_back(bare(line.substr(0, end)));
    if (end == std::string_view::npos) return out;
    line.remove_prefix(end + 1);
  }
}

/// A text file read line by line.
class LineReader {
 public:
  LineReader(const std::filesystem::path& path, const char* what)
      : file_(path.string()), text_(read_input_file(path, what, kRecordingBytes)), rest_(text_) {}

  bool next(std::string_view& line) {
    if (rest_.empty()) return false;
    line = take_line(rest_);
    ++number_;
    return true;
  }
  [[noreturn]] void fail(std::string got, std::string need, std::string key = {}) const {
    throw Error({Problem{Place{file_, number_, 1}, std::move(key), std::move(got), std::move(need)}});
  }
  /// A number; nothing for an empty field or `nan`.
  std::optional<double> number(std::string_view text) const {
    if (text.empty() || lower_case(text) == "nan") return std::nullopt;
    const auto value = parse_number(text);
    if (!value)
      fail(fmt::format("\"{}\"", printable(text)), "a number, or nothing for a point that was not seen");
    return value;
  }
  void add_time(Recording& out, std::string_view text) const {
    const auto time = number(text);
    if (!time || (!out.times.empty() && !(*time > out.times.back())))
      fail(fmt::format("time \"{}\"", text), "increasing times in s", "time");
    if (out.times.size() == kMostFrames) fail("more frames", fmt::format("at most {}", kMostFrames));
    out.times.push_back(*time);
  }
  const std::string& file() const { return file_; }

 private:
  std::string file_, text_;
  std::string_view rest_;
  int number_ = 0;
};

/// `right.index_pip` of `right.6`.
std::string keypoint_name(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  if (dot == std::string::npos) return name;
  const auto index = parse_number(name.substr(dot + 1));
  const std::vector<std::string> names = keypoint_names();
  if (!index || !(*index >= 0 && *index < static_cast<double>(names.size()))) return name;
  return name.substr(0, dot + 1) + names[static_cast<std::size_t>(*index)];
}

constexpr std::array<std::string_view, 7> kParts = {".x", ".y", ".z", ".qw", ".qx", ".qy", ".qz"};

/// Where the parts of a channel stand in a row.
struct ChannelColumns {
  std::array<std::optional<std::size_t>, 7> at;
  double unit = 1;

  bool has(std::size_t first, std::size_t count) const {
    return std::all_of(at.begin() + static_cast<std::ptrdiff_t>(first),
                       at.begin() + static_cast<std::ptrdiff_t>(first + count),
                       [](const auto& column) { return column.has_value(); });
  }
};

std::map<std::string, ChannelColumns> read_head(const LineReader& reader,
                                                const std::vector<std::string_view>& labels) {
  if (labels[0] != "time" && labels[0] != "time[s]")
    reader.fail(fmt::format("\"{}\"", printable(labels[0])), "time[s] as the first column");
  std::map<std::string, ChannelColumns> out;
  for (std::size_t c = 1; c < labels.size(); ++c) {
    const std::size_t bracket = labels[c].find('[');
    const std::string_view unit = bracket == std::string_view::npos ? "[m]" : labels[c].substr(bracket);
    const std::string_view name = labels[c].substr(0, bracket);
    for (std::size_t p = 0; p < kParts.size(); ++p) {
      if (!name.ends_with(kParts[p])) continue;
      if (unit != "[m]" && unit != "[mm]")
        reader.fail(fmt::format("the unit {}", unit), "[m] or [mm]", std::string(name));
      ChannelColumns& channel =
          out[keypoint_name(std::string(name.substr(0, name.size() - kParts[p].size())))];
      if (channel.at[p]) reader.fail("a second column", "each column once", std::string(name));
      channel.at[p] = c;
      if (p < 3) channel.unit = unit == "[mm]" ? 1e-3 : 1;
    }
  }
  for (const auto& [name, channel] : out)
    if (!channel.has(0, 3) && !channel.has(3, 4))
      reader.fail(fmt::format("only some columns of {}", name), "x, y and z, or qw, qx, qy and qz", name);
  if (out.empty()) reader.fail("no column of a point or sensor", "columns such as right.wrist.x[m]");
  return out;
}

Recording read_csv(const std::filesystem::path& path) {
  LineReader reader(path, "a recording (.csv, .json, .trc)");
  Recording out;
  out.file = reader.file();
  std::string_view line;
  if (!reader.next(line)) reader.fail("an empty file", "a line of column names, then rows");
  const std::vector<std::string_view> labels = parts_of(line, ',');
  const std::map<std::string, ChannelColumns> columns = read_head(reader, labels);
  std::vector<std::optional<double>> row(labels.size());
  while (reader.next(line)) {
    if (bare(line).empty()) continue;
    const std::vector<std::string_view> fields = parts_of(line, ',');
    if (fields.size() != labels.size())
      reader.fail(fmt::format("{} values", fields.size()),
                  fmt::format("{}, one for each column", labels.size()));
    reader.add_time(out, fields[0]);
    for (std::size_t i = 1; i < fields.size(); ++i) row[i] = reader.number(fields[i]);
    for (const auto& [name, of_channel] : columns) {
      const ChannelColumns& from = of_channel;  // clang 14 captures no structured binding
      const auto value = [&](std::size_t part) { return from.at[part] ? row[*from.at[part]] : std::nullopt; };
      Channel& channel = out.channels[name];
      channel.points.emplace_back();
      channel.orientations.emplace_back();
      if (value(0) && value(1) && value(2))
        channel.points.back() = from.unit * Vec3(*value(0), *value(1), *value(2));
      if (!value(3) || !value(4) || !value(5) || !value(6)) continue;
      const Quat q(*value(3), *value(4), *value(5), *value(6));
      if (!(std::abs(q.norm() - 1) < 0.01))
        reader.fail(fmt::format("a quaternion of length {:.4g}", q.norm()), "one of length 1", name);
      channel.orientations.back() = q.normalized();
    }
  }
  return out;
}

// Lines of a .trc: its type; names of the head's values; those values; Frame#, Time and marker names, each
// above three columns; the labels X1, Y1, Z1, ...; then the rows.
Recording read_trc(const std::filesystem::path& path) {
  LineReader reader(path, "a recording (.csv, .json, .trc)");
  Recording out;
  out.file = reader.file();
  std::string_view line;
  std::array<std::vector<std::string_view>, 5> head;
  for (auto& each : head) {
    if (!reader.next(line)) reader.fail("the end of the file", "the five lines of a .trc header");
    each = parts_of(line, '\t');
  }
  const auto units = std::find(head[1].begin(), head[1].end(), "Units");
  const auto index = static_cast<std::size_t>(units - head[1].begin());
  if (units == head[1].end() || index >= head[2].size() || (head[2][index] != "mm" && head[2][index] != "m"))
    reader.fail("no Units m or mm in the header", "a header with Units", "Units");
  const double unit = head[2][index] == "mm" ? 1e-3 : 1;
  std::vector<std::pair<std::string, std::size_t>> markers;
  for (std::size_t c = 2; c < head[3].size(); c += 3)
    if (!head[3][c].empty()) markers.emplace_back(std::string(head[3][c]), c);
  if (markers.empty()) reader.fail("no marker", "names of markers after Frame# and Time");
  while (reader.next(line)) {
    if (bare(line).empty()) continue;
    std::vector<std::string_view> fields = parts_of(line, '\t');
    if (fields.size() < 2) reader.fail("a short row", "a frame number, a time and coordinates");
    fields.resize(std::max(fields.size(), markers.back().second + 3));
    reader.add_time(out, fields[1]);
    for (const auto& [name, column] : markers) {
      Channel& channel = out.channels[name];
      channel.orientations.emplace_back();
      const auto x = reader.number(fields[column]), y = reader.number(fields[column + 1]),
                 z = reader.number(fields[column + 2]);
      channel.points.push_back(x && y && z ? std::optional(Vec3(unit * Vec3(*x, *y, *z))) : std::nullopt);
    }
  }
  return out;
}

using Document = nlohmann::json;

/// Reads frames of keypoints from JSON.
class JsonRecording {
 public:
  explicit JsonRecording(const std::filesystem::path& path) : names_(keypoint_names()) {
    out_.file = path.string();
    const std::string text = read_input_file(path, "a recording (.csv, .json, .trc)", kRecordingBytes);
    try {
      read(Document::parse(text));
    } catch (const Document::exception& error) {
      fail("", printable(error.what(), 200), "JSON with a list of frames");
    }
  }
  Recording take() { return std::move(out_); }

 private:
  [[noreturn]] void fail(std::string key, std::string got, std::string need) const {
    throw Error({Problem{Place{out_.file, 1, 1}, std::move(key), std::move(got), std::move(need)}});
  }

  void read(const Document& root) {
    const Document& frames = root.is_array() ? root : root.at("frames");
    const std::string unit = root.is_object() ? root.value("unit", "m") : "m";
    if (unit != "m" && unit != "mm") fail("unit", unit, "m or mm");
    unit_ = unit == "mm" ? 1e-3 : 1;
    const double rate = root.is_object() ? root.value("rate", 0.0) : 0;
    for (const char* side : {"right", "left"})
      for (const std::string& name : names_) out_.channels[std::string(side) + "." + name];
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const std::string key = fmt::format("frames.{}", i);
      if (!frames[i].contains("time") && !(rate > 0)) fail(key, "no time", "a time in s, or a rate in Hz");
      const double time =
          frames[i].contains("time") ? frames[i]["time"].get<double>() : static_cast<double>(i) / rate;
      if (!out_.times.empty() && !(time > out_.times.back()))
        fail(key, "a time that does not increase", "one");
      out_.times.push_back(time);
      for (auto& [name, channel] : out_.channels) {
        channel.points.emplace_back();
        channel.orientations.emplace_back();
      }
      for (const Document& hand : frames[i].at("hands")) add_hand(key, hand);
    }
    std::erase_if(out_.channels, [](const auto& each) {
      return std::none_of(each.second.points.begin(), each.second.points.end(),
                          [](const auto& point) { return point.has_value(); });
    });
  }

  void add_hand(const std::string& key, const Document& hand) {
    const std::string side = lower_case(hand.at("side").get<std::string>());
    if (side != "right" && side != "left") fail(key, fmt::format("the side {}", side), "right or left");
    const Document& points = hand.at("points");
    if (points.size() != names_.size())
      fail(key, fmt::format("{} points", points.size()), "21 points, null for those not seen");
    for (std::size_t p = 0; p < names_.size(); ++p) {
      const Document& point = points[p];
      if (point.is_null()) continue;
      const auto value = [&](int index, const char* name) {
        return unit_ *
               (point.is_array() ? point.at(static_cast<std::size_t>(index)) : point.at(name)).get<double>();
      };
      out_.channels[side + "." + names_[p]].points.back() = Vec3(value(0, "x"), value(1, "y"), value(2, "z"));
    }
  }

  std::vector<std::string> names_;
  double unit_ = 1;
  Recording out_;
};

}  // namespace

Recording read_recording(const std::filesystem::path& path) {
  const std::string ending = lower_case(path.extension().string());
  if (ending != ".csv" && ending != ".json" && ending != ".trc")
    throw input_error(path.string(), "a file of another kind", "a recording: .csv, .json or .trc");
  Recording out = ending == ".csv"    ? read_csv(path)
                  : ending == ".json" ? JsonRecording(path).take()
                                      : read_trc(path);
  if (out.times.empty()) throw input_error(path.string(), "no frame", "a recording with frames");
  return out;
}

}  // namespace handsim::study
