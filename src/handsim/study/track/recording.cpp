#include "handsim/study/track/recording.h"

#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "handsim/core/error.h"
#include "handsim/core/input_file.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"
#include "handsim/study/track/hand_tree.h"

namespace handsim::study {

namespace {

/// A recording being read, and the place in its file.
class RecordingReader {
 public:
  static constexpr std::size_t kMostBytes = 512U << 20U;
  static constexpr std::size_t kMostFrames = 1'000'000;
  static constexpr double kShortestInterval = 1e-6;  ///< between frames [s]
  static constexpr double kFarthest = 1000;          ///< of a point from the origin [m]

  RecordingReader(const std::filesystem::path& path, const RecordingFormat& format)
      : format_(format),
        text_(read_text_file(path, "a recording (.csv, .json, .trc, .c3d)", kMostBytes)),
        place_{path.string(), 1, 1} {
    out_.file = path.string();
  }
  [[noreturn]] void fail(std::string got, std::string need, std::string key = {}) const {
    throw Error({Problem{place_, std::move(key), std::move(got), std::move(need)}});
  }
  void add_time(double time) {
    if (!out_.times.empty() && !(time - out_.times.back() >= kShortestInterval))
      fail(fmt::format("{:.12g} s after {:.12g} s", time, out_.times.back()),
           fmt::format("times in s that increase, by {:g} s at least", kShortestInterval), "time");
    if (!out_.times.empty() && !(time - out_.times.front() <= kLongestRecording))
      fail(fmt::format("{:.6g} s after the first frame", time - out_.times.front()),
           fmt::format("a recording of at most {:g} s", kLongestRecording), "time");
    if (out_.times.size() == kMostFrames) fail("more frames", fmt::format("at most {}", kMostFrames));
    out_.times.push_back(time);
  }
  /// The frame that add_time() has begun.
  std::size_t frame() const { return out_.times.size() - 1; }
  void check_place(const Vec3& point, const std::string& name) const {
    if (!(point.cwiseAbs().maxCoeff() <= kFarthest))
      fail(fmt::format("a point {:.3g} m away", point.cwiseAbs().maxCoeff()),
           fmt::format("one within {:g} m of the origin: the unit may be another one", kFarthest), name);
  }

 protected:
  /// `right.index_pip` of `right.6`.
  std::string point_name(const std::string& name) const {
    const std::size_t dot = name.rfind('.');
    if (dot == std::string::npos) return name;
    const auto index = parse_number(name.substr(dot + 1));
    if (!index || !(*index >= 0 && *index < static_cast<double>(format_.names.size()))) return name;
    return name.substr(0, dot + 1) + format_.names[static_cast<std::size_t>(*index)];
  }

  const RecordingFormat& format_;
  std::string text_;
  Place place_;
  Recording out_;
};

/// A text file read line by line.
class LineReader : public RecordingReader {
 public:
  LineReader(const std::filesystem::path& path, const RecordingFormat& format)
      : RecordingReader(path, format), rest_(text_) {
    place_.line = 0;
  }
  using RecordingReader::point_name;

  bool next(std::string_view& line) {
    if (rest_.empty()) return false;
    line = take_line(rest_);
    ++place_.line;
    return true;
  }
  /// True if the file ends within the line that was read last.
  bool unfinished() const { return rest_.empty() && !text_.ends_with('\n'); }
  /// A number; nothing for an empty field or `nan`.
  std::optional<double> number(std::string_view text) const {
    if (text.empty() || lower_case(text) == "nan") return std::nullopt;
    const auto value = parse_number(text);
    if (!value)
      fail(fmt::format("\"{}\"", printable(text)), "a number, or nothing for a point that was not seen");
    return value;
  }
  std::optional<Vec3> point(std::string_view x, std::string_view y, std::string_view z) const {
    const auto a = number(x), b = number(y), c = number(z);
    return a && b && c ? std::optional(Vec3(*a, *b, *c)) : std::nullopt;
  }
  void add_point(Channel& channel, const std::string& name, const Vec3& point) const {
    check_place(point, name);
    channel.points.add(frame(), point);
  }
  void begin_frame(std::string_view time) {
    const auto value = number(time);
    if (!value) fail("no time", "a time in s", "time");
    add_time(*value);
  }
  Recording& out() { return out_; }

 private:
  std::string_view rest_;
};

constexpr std::array<std::string_view, 7> kParts = {".x", ".y", ".z", ".qw", ".qx", ".qy", ".qz"};

/// Where the parts of a channel stand in a row.
struct ChannelColumns {
  std::array<std::optional<std::size_t>, 7> at;
  Vec3 unit = Vec3::Ones();  ///< of x, y and z [m]

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
          out[reader.point_name(std::string(name.substr(0, name.size() - kParts[p].size())))];
      if (channel.at[p]) reader.fail("a second column", "each column once", std::string(name));
      channel.at[p] = c;
      if (p < 3 && unit == "[mm]") channel.unit[static_cast<Eigen::Index>(p)] = 1e-3;
    }
  }
  for (const auto& [name, channel] : out)
    if (!channel.has(0, 3) && !channel.has(3, 4))
      reader.fail(fmt::format("only some columns of {}", name), "x, y and z, or qw, qx, qy and qz", name);
  if (out.empty()) reader.fail("no column of a point or sensor", "columns such as right.wrist.x[m]");
  return out;
}

Recording read_csv(const std::filesystem::path& path, const RecordingFormat& format) {
  LineReader reader(path, format);
  std::string_view line;
  if (!reader.next(line)) reader.fail("an empty file", "a line of column names, then rows");
  const std::vector<std::string_view> labels = split(line, ',');
  const std::map<std::string, ChannelColumns> columns = read_head(reader, labels);
  while (reader.next(line)) {
    if (trimmed(line).empty()) continue;
    const std::vector<std::string_view> fields = split(line, ',');
    if (fields.size() != labels.size())
      reader.fail(fmt::format("{} values", fields.size()),
                  fmt::format("{}, one for each column", labels.size()));
    reader.begin_frame(fields[0]);
    for (const auto& [name, from] : columns) {
      Channel& channel = reader.out().channels[name];
      if (from.at[0])
        if (const auto point = reader.point(fields[*from.at[0]], fields[*from.at[1]], fields[*from.at[2]]))
          reader.add_point(channel, name, from.unit.cwiseProduct(*point));
      if (!from.at[3]) continue;
      const auto w = reader.number(fields[*from.at[3]]);
      const auto axis = reader.point(fields[*from.at[4]], fields[*from.at[5]], fields[*from.at[6]]);
      if (!w || !axis) continue;
      const Quat q(*w, axis->x(), axis->y(), axis->z());
      if (!(std::abs(q.norm() - 1) < 0.01))
        reader.fail(fmt::format("a quaternion of length {:.4g}", q.norm()), "one of length 1", name);
      channel.orientations.add(reader.frame(), q.normalized());
    }
  }
  return std::move(reader.out());
}

/// The head of a .trc: its type; names of the head's values; those values; Frame#, Time and marker names,
/// each above three columns; the labels X1, Y1, Z1, ...; then the rows.
struct TrcHead {
  std::array<std::vector<std::string_view>, 5> lines;

  std::optional<std::string_view> find(std::string_view key) const {
    const auto found = std::ranges::find(lines[1], key);
    const auto index = static_cast<std::size_t>(found - lines[1].begin());
    return index < lines[1].size() && index < lines[2].size() ? std::optional(lines[2][index]) : std::nullopt;
  }
  /// The head states a number that the file does not have: often the file was cut.
  void check(const LineReader& reader, const char* key, std::size_t count) const {
    const auto stated = find(key);
    if (stated && parse_number(*stated) != static_cast<double>(count))
      reader.fail(fmt::format("{}", count),
                  fmt::format("{}, as the head says: is the file complete?", printable(*stated)), key);
  }
};

Recording read_trc(const std::filesystem::path& path, const RecordingFormat& format) {
  LineReader reader(path, format);
  std::string_view line;
  TrcHead head;
  for (auto& each : head.lines) {
    if (!reader.next(line)) reader.fail("the end of the file", "the five lines of a .trc header");
    each = split(line, '\t');
  }
  const std::string_view units = head.find("Units").value_or("none");
  if (units != "mm" && units != "m")
    reader.fail(fmt::format("the unit {}", printable(units)), "Units m or mm in the header", "Units");
  const double unit = units == "mm" ? 1e-3 : 1;
  std::vector<std::pair<std::string, std::size_t>> markers;
  const std::vector<std::string_view>& names = head.lines[3];
  for (std::size_t c = 2; c < names.size(); c += 3) {
    if (names[c].empty()) continue;
    markers.emplace_back(std::string(names[c]), c);
    if (!reader.out().channels.try_emplace(markers.back().first).second)
      reader.fail("a second marker of this name", "each name once", markers.back().first);
  }
  if (markers.empty()) reader.fail("no marker", "names of markers after Frame# and Time");
  head.check(reader, "NumMarkers", markers.size());
  while (reader.next(line)) {
    if (trimmed(line).empty()) continue;
    std::vector<std::string_view> fields = split(line, '\t');
    // Markers at the end of a row that were not seen may have no tabs.
    const std::size_t width = markers.back().second + 3;
    const bool within_marker = fields.size() % 3 != 2 && !fields.back().empty();
    if (fields.size() < 2 || (fields.size() < width && (reader.unfinished() || within_marker)))
      reader.fail(fmt::format("{} values", fields.size()),
                  fmt::format("{}: a frame number, a time, three coordinates of each marker", width));
    fields.resize(std::max(fields.size(), width));
    reader.begin_frame(fields[1]);
    for (const auto& [name, column] : markers)
      if (const auto point = reader.point(fields[column], fields[column + 1], fields[column + 2]))
        reader.add_point(reader.out().channels[name], name, unit * *point);
  }
  head.check(reader, "NumFrames", reader.out().times.size());
  return std::move(reader.out());
}

/// Bytes of a file for the parser; reading them moves a place along.
struct PlacedBytes {
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;
  const char* at = nullptr;
  Place* place = nullptr;

  reference operator*() const { return *at; }
  PlacedBytes& operator++() {
    const bool ends = *at++ == '\n';
    place->line += ends ? 1 : 0;
    place->column = ends ? 1 : place->column + 1;
    return *this;
  }
  bool operator==(const PlacedBytes& other) const { return at == other.at; }
};

using Document = nlohmann::json;

/// Reads frames of keypoints from JSON, of which the parser keeps one frame at a time.
class JsonReader : public RecordingReader {
 public:
  using RecordingReader::RecordingReader;

  Recording read() {
    const char* const begin = text_.data();
    const auto keep = [this](int depth, Document::parse_event_t event, const Document& value) {
      return keeps(depth, event, value);
    };
    try {
      const Document head =
          Document::parse(PlacedBytes{begin, &place_}, PlacedBytes{begin + text_.size(), &place_}, keep);
      if (!any_frames_) fail("no frames", "JSON with a list of frames", "frames");
      if (head.is_object())
        finish(head.value("rate", 0.0), head.value("unit", ""));
      else
        finish(0, "");
    } catch (const Document::exception& error) {
      fail(printable(error.what(), 200), "JSON with a list of frames", any_frames_ ? key() : "");
    }
    if (doubled_ > 0)
      out_.warnings.push_back(fmt::format(
          "{}: {} frames have two hands of one side, the first of them frames.{}: neither is used there",
          out_.file, doubled_, first_doubled_));
    return std::move(out_);
  }

 private:
  std::string key() const { return fmt::format("frames.{}", count_); }

  /// False for a frame that has been read, and for what is no part of a recording.
  bool keeps(int depth, Document::parse_event_t event, const Document& value) {
    using Event = Document::parse_event_t;
    const bool list = event == Event::array_start;
    if (depth == 0) in_frames_ = in_frames_ || list;
    if (depth == 1 && event == Event::key) {
      in_frames_ = value == "frames";
      if (in_frames_ && any_frames_) fail("a second list", "one list of frames", "frames");
      return in_frames_ || value == "rate" || value == "unit";
    }
    if (!in_frames_) return true;
    if (!any_frames_) {
      any_frames_ = list;
      level_ = depth + 1;
    } else if (depth == level_ &&
               (event == Event::object_end || event == Event::array_end || event == Event::value)) {
      add_frame(value);
      ++count_;
      return false;
    }
    return true;
  }

  void add_frame(const Document& frame) {
    const Document& hands = frame.at("hands");
    if (!hands.is_array())
      fail("hands that are no list", "a list of hands, empty where none was seen", key());
    if (frame.contains("time")) {
      add_time(frame["time"].get<double>());
    } else {
      if (++untimed_ > kMostFrames) fail("more frames", fmt::format("at most {}", kMostFrames));
      out_.times.push_back(0);
    }
    std::array<std::vector<const Document*>, 2> of_side;
    for (const Document& hand : hands) {
      const std::string side = lower_case(hand.at("side").get<std::string>());
      if (side != "right" && side != "left")
        fail(fmt::format("the side {}", printable(side)), "right or left", key());
      of_side[side == "right" ? 0 : 1].push_back(&hand);
      if (const Document& points = hand.at("points");
          points.is_array() && points.size() != format_.names.size())
        fail(fmt::format("{} points", points.size()),
             fmt::format("{} points, null for those not seen; --points names other trackers",
                         format_.names.size()),
             key());
    }
    // Nobody knows which of two right hands is the right one.
    if ((of_side[0].size() > 1 || of_side[1].size() > 1) && doubled_++ == 0) first_doubled_ = count_;
    if (of_side[0].size() == 1) add_hand("right.", *of_side[0][0]);
    if (of_side[1].size() == 1) add_hand("left.", *of_side[1][0]);
  }

  void add_hand(const std::string& side, const Document& hand) {
    const Document& points = hand["points"];
    for (std::size_t p = 0; p < format_.names.size(); ++p) {
      const Document point = points.is_array() ? points[p] : points.value(format_.names[p], Document());
      std::array<std::optional<double>, 3> x;
      for (std::size_t i = 0; i < 3 && !point.is_null(); ++i)
        if (const Document& value = point.is_array() ? point.at(i) : point.at(std::string(1, "xyz"[i]));
            !value.is_null())
          x[i] = value.get<double>();
      if (x[0] && x[1] && x[2])
        out_.channels[side + format_.names[p]].points.add(count_, {*x[0], *x[1], *x[2]});
    }
  }

  /// What the head says may stand behind the frames.
  void finish(double rate, const std::string& unit) {
    place_ = {place_.file, 1, 1};
    const double size = unit.empty() ? format_.unit : unit == "m" ? 1 : unit == "cm" ? 1e-2 : 1e-3;
    if (!unit.empty() && unit != "m" && unit != "cm" && unit != "mm")
      fail(printable(unit), "m, cm or mm", "unit");
    for (auto& [name, channel] : out_.channels)
      for (std::size_t i = 0; i < channel.points.values().size(); ++i) {
        Vec3& point = channel.points.values()[i];
        point *= size;
        check_place(point, fmt::format("frames.{}: {}", channel.points.frames()[i], name));
      }
    if (untimed_ == 0) return;
    if (untimed_ < count_ || rate == 0)
      fail(fmt::format("no time in {} of {} frames", untimed_, count_),
           "a time in s in every frame, or a rate in Hz", "frames");
    if (!(rate > 0 && rate * kShortestInterval <= 1))
      fail(fmt::format("{:g}", rate), "a rate above 0 to 1e6 Hz", "rate");
    for (std::size_t i = 0; i < count_; ++i) out_.times[i] = static_cast<double>(i) / rate;
    if (out_.times.back() > kLongestRecording)
      fail(fmt::format("{} frames at {:g} Hz", count_, rate),
           fmt::format("at most {:g} s", kLongestRecording), "rate");
  }

  bool in_frames_ = false, any_frames_ = false;
  int level_ = 0;                                                          ///< depth of a frame
  std::size_t count_ = 0, untimed_ = 0, doubled_ = 0, first_doubled_ = 0;  ///< frames
};

/// Takes out what the tracker writes for a point that it does not see, and turns the axes.
void apply(const RecordingFormat& format, Recording& recording) {
  // Of each hand, frames whose points are all at one place.
  for (const std::string hand : {"right.", "left."}) {
    std::vector<Seen<Vec3>*> points;
    for (const std::string& name : format.names)
      if (const auto found = recording.channels.find(hand + name); found != recording.channels.end())
        points.push_back(&found->second.points);
    if (points.size() < 3) continue;
    std::vector<bool> spread(recording.times.size(), false);
    std::vector<std::optional<Vec3>> first(recording.times.size());
    for (const Seen<Vec3>* each : points)
      for (std::size_t i = 0; i < each->values().size(); ++i) {
        const std::uint32_t k = each->frames()[i];
        if (!first[k]) first[k] = each->values()[i];
        if (*first[k] != each->values()[i]) spread[k] = true;
      }
    for (Seen<Vec3>* each : points) each->remove([&](std::uint32_t k) { return !spread[k]; });
  }
  Mat3 turn = Mat3::Identity();
  if (format.left_handed) turn(format.up == 'z' ? 1 : 2, format.up == 'z' ? 1 : 2) = -1;
  if (const double up = format.up == 'Y' ? -1 : 1; format.up != 'z')
    turn = Mat3{{1, 0, 0}, {0, 0, -up}, {0, up, 0}} * turn;
  for (auto& [name, channel] : recording.channels) {
    Seen<Vec3>& points = channel.points;
    if (format.origin_unseen) points.remove([&](std::uint32_t k) { return points.at(k)->isZero(0); });
    if (!turn.isIdentity(0))
      for (Vec3& point : points.values()) point = turn * point;
    if (!format.left_handed)
      for (Quat& q : channel.orientations.values()) q = Quat(turn) * q;
  }
}

}  // namespace

Recording read_recording(const std::filesystem::path& path, RecordingFormat format) {
  const std::string ending = lower_case(path.extension().string());
  if (ending != ".csv" && ending != ".json" && ending != ".trc")
    throw input_error(path.string(), "a file of another kind", "a recording: .csv, .json, .trc or .c3d");
  if (format.names.empty()) format.names = keypoint_names();
  Recording out = ending == ".csv"    ? read_csv(path, format)
                  : ending == ".json" ? JsonReader(path, format).read()
                                      : read_trc(path, format);
  if (out.times.empty()) throw input_error(path.string(), "no frame", "a recording with frames");
  apply(format, out);
  return out;
}

}  // namespace handsim::study
