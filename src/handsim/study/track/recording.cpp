#include "handsim/study/track/recording.h"

#include <array>
#include <cmath>
#include <optional>

#include "handsim/study/track/hand_tree.h"
#include "handsim/study/track/recording_reader.h"

namespace handsim::study {

namespace {

/// A text file read line by line.
class LineReader : public RecordingReader {
 public:
  LineReader(const std::filesystem::path& path, const RecordingFormat& format)
      : RecordingReader(path, format), rest_(text_) {
    place_.line = 0;
  }
  using RecordingReader::point_name;
  const RecordingFormat& format() const { return format_; }

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

/// Columns of a row in which the parts of a channel stand.
struct ChannelColumns {
  std::array<std::optional<std::size_t>, 7> at;
  Vec3 unit = Vec3::Ones();               ///< of x, y and z [m]
  std::optional<std::size_t> confidence;  ///< column of it

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
  std::map<std::string, std::size_t> confidences;  // columns, by channel or hand
  const std::string confidence = "." + reader.format().confidence;
  for (std::size_t c = 1; c < labels.size(); ++c) {
    const std::size_t bracket = labels[c].find('[');
    const std::string_view unit = bracket == std::string_view::npos ? "[m]" : labels[c].substr(bracket);
    const std::string_view name = labels[c].substr(0, bracket);
    if (name.ends_with(confidence))
      confidences[reader.point_name(std::string(name.substr(0, name.size() - confidence.size())))] = c;
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
  for (auto& [name, channel] : out) {
    if (!channel.has(0, 3) && !channel.has(3, 4))
      reader.fail(fmt::format("only some columns of {}", name), "x, y and z, or qw, qx, qy and qz", name);
    for (const std::string& of : {name, name.substr(0, name.find('.'))})
      if (const auto found = confidences.find(of); found != confidences.end() && !channel.confidence)
        channel.confidence = found->second;
  }
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
        if (const auto point = reader.point(fields[*from.at[0]], fields[*from.at[1]], fields[*from.at[2]])) {
          reader.add_point(channel, name, from.unit.cwiseProduct(*point));
          if (const auto sure = from.confidence ? reader.number(fields[*from.confidence]) : std::nullopt)
            reader.add_confidence(channel, name, *sure);
        }
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
  char between = '\0';
  for (auto& each : head.lines) {
    if (!reader.next(line)) reader.fail("the end of the file", "the five lines of a .trc header");
    // Spreadsheets save it with commas.
    if (between == '\0') between = line.find('\t') == line.npos && line.find(',') != line.npos ? ',' : '\t';
    each = split(line, between);
  }
  const std::string_view units = head.find("Units").value_or("none");
  if (units != "mm" && units != "m")
    reader.fail(fmt::format("the unit {}", printable(units)), "Units m or mm in the header", "Units");
  const double unit = units == "mm" ? 1e-3 : 1;
  std::vector<std::pair<std::string, std::size_t>> markers;
  const std::vector<std::string_view>& names = head.lines[3];
  for (std::size_t c = 2; c < names.size(); c += 3) {
    if (names[c].empty()) continue;
    markers.emplace_back(reader.point_name(std::string(names[c])), c);
    if (!reader.out().channels.try_emplace(markers.back().first).second)
      reader.fail("a second marker of this name", "each name once", markers.back().first);
  }
  if (markers.empty()) reader.fail("no marker", "names of markers after Frame# and Time");
  head.check(reader, "NumMarkers", markers.size());
  while (reader.next(line)) {
    if (line.find_first_not_of(", \t\r") == line.npos) continue;
    std::vector<std::string_view> fields = split(line, between);
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

/// Takes out points of which the tracker is not sure.
void remove_doubtful(const RecordingFormat& format, Recording& recording) {
  std::size_t stated = 0, doubtful = 0;
  bool any = false;
  for (const auto& [name, channel] : recording.channels)
    for (const double confidence : channel.confidences.values()) {
      ++stated;
      any = any || confidence != 0;
      if (confidence < format.least_confidence) ++doubtful;
    }
  if (doubtful == 0) return;
  if (any)
    recording.warnings.push_back(
        fmt::format("{}: {} of {} points have a {} below {:g}: they count as not seen", recording.file,
                    doubtful, stated, format.confidence, format.least_confidence));
  else
    recording.warnings.push_back(
        fmt::format("{}: every {} is 0: the tracker does not state it", recording.file, format.confidence));
  for (auto& [name, channel] : recording.channels) {
    const Seen<double>& of = channel.confidences;
    if (any)
      channel.points.remove([&](std::uint32_t k) { return of.at(k) && *of.at(k) < format.least_confidence; });
    else
      channel.confidences = {};
  }
}

/// Takes out what the tracker writes for a point that it does not see, and turns the axes.
void apply(const RecordingFormat& format, Recording& recording) {
  remove_doubtful(format, recording);
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

std::string plain_name(std::string_view name) {
  std::string out = lower_case(name);
  std::ranges::replace(out, '-', '_');
  for (const auto& [part, plain] : {std::pair<std::string_view, std::string_view>{"xr_hand_joint_", ""},
                                    {"_ext", ""},
                                    {"_finger_", "_"},
                                    {"phalanx_", ""},
                                    {"pinky", "little"}})
    if (const std::size_t at = out.find(part); at != std::string::npos) out.replace(at, part.size(), plain);
  return out;
}

Recording read_recording(const std::filesystem::path& path, RecordingFormat format) {
  const std::string ending = lower_case(path.extension().string());
  if (ending != ".csv" && ending != ".json" && ending != ".trc")
    throw input_error(path.string(), "a file of another kind", "a recording: .csv, .json, .trc or .c3d");
  if (format.names.empty()) format.names = keypoint_names();
  Recording out = ending == ".csv"    ? read_csv(path, format)
                  : ending == ".json" ? read_json_recording(path, format)
                                      : read_trc(path, format);
  if (out.times.empty()) throw input_error(path.string(), "no frame", "a recording with frames");
  apply(format, out);
  return out;
}

}  // namespace handsim::study
