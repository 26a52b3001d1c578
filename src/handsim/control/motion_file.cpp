#include "handsim/control/motion_file.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_set>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"

namespace handsim::control {

namespace {

constexpr std::string_view kTarget = ".target";
constexpr std::size_t kMaxProblems = 20;

std::vector<std::string_view> split_blanks(std::string_view line) {
  std::vector<std::string_view> out;
  std::size_t begin = 0;
  while ((begin = line.find_first_not_of(" \t\r", begin)) != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(" \t\r", begin), line.size());
    out.push_back(line.substr(begin, end - begin));
    begin = end;
  }
  return out;
}

/// NAME of `/jointset/right_index_mcp/NAME/value`.
std::string coordinate_of(std::string_view label) {
  if (!label.starts_with('/')) return std::string(label);
  if (label.ends_with("/value")) label.remove_suffix(6);
  return std::string(label.substr(label.rfind('/') + 1));
}

/// True for the last part of a column of a pose: `x`, `qw`, `rx`, `axis.x`, `angle`.
bool is_pose_column(std::string_view name) {
  constexpr std::string_view kParts[] = {"x",  "y",  "z",  "qw",     "qx",     "qy",     "qz",
                                         "rx", "ry", "rz", "axis.x", "axis.y", "axis.z", "angle"};
  return std::any_of(std::begin(kParts), std::end(kParts), [&](std::string_view part) {
    return name == part ||
           (name.ends_with(part) && name.substr(0, name.size() - part.size()).ends_with(".wrist."));
  });
}

class Reader {
 public:
  Reader(const std::filesystem::path& path, TableContent content)
      : name_(path.string()),
        content_(content),
        text_(read_text_file(path, "a table of joint angles (.csv, .mot, .sto)", kMotionMaxBytes)),
        rest_(text_) {
    table_.file = name_;
    table_.radians = true;
  }

  MotionTable read(bool opensim) {
    opensim ? read_opensim_header() : read_csv_header();
    stop_if_bad();
    while (next_line()) {
      if (!trimmed(line_).empty()) read_row(opensim ? split_blanks(line_) : split(line_, ','));
      if (problems_.size() >= kMaxProblems) break;
    }
    if (problems_.empty() && table_.times.empty()) problem(1, "", "no rows", "at least one row of angles");
    if (problems_.empty() && stated_rows_ && *stated_rows_ != table_.times.size())
      problem(1, "nRows", fmt::format("{} rows", table_.times.size()),
              fmt::format("{}, the value of nRows", *stated_rows_));
    stop_if_bad();
    return std::move(table_);
  }

 private:
  bool next_line() {
    if (rest_.empty()) return false;
    line_ = take_line(rest_);
    ++number_;
    return true;
  }

  int column_of(std::string_view field) const { return static_cast<int>(field.data() - line_.data()) + 1; }
  void problem(int column, std::string key, std::string got, std::string need) {
    if (problems_.size() >= kMaxProblems) return;
    problems_.push_back({Place{name_, number_, column}, std::move(key), std::move(got), std::move(need)});
  }
  void stop_if_bad() const {
    if (!problems_.empty()) throw Error(problems_);
  }

  /// A label `NAME`, `NAME[unit]` or `NAME.target[unit]`; others are ignored. @param default_factor to rad
  void read_label(std::string_view field, std::size_t index, double default_factor) {
    const std::size_t bracket = field.find('[');
    const std::string_view unit = bracket == std::string_view::npos ? "" : field.substr(bracket);
    std::string name = coordinate_of(field.substr(0, bracket));
    const bool pose = is_pose_column(name);
    std::map<std::string_view, double> units = {{"", default_factor}, {"[rad]", 1}, {"[deg]", kDegree}};
    const char* need = "[rad] or [deg]";
    if (content_ == TableContent::angles) {
      if (name.size() > 3 && name[name.size() - 3] == '.' && name[name.size() - 2] == 'q') return;
      for (const std::string_view other : {"[m]", "[mm]", "[rad/s]", "[m/s]", "[N_m]", "[N]", "[]"})
        if (unit == other) return;
    } else if (content_ == TableContent::excitations) {
      units = {{"", 1}, {"[]", 1}, {"[rad]", 1}};
      need = "no unit, or []: excitations are numbers of 0 to 1";
    } else if (!pose) {
      return;
    } else if (!name.ends_with("angle") && !(name.size() >= 2 && name[name.size() - 2] == 'r')) {
      units = {{"", 1}, {"[m]", 1}, {"[mm]", 1e-3}};
      need = "[m] or [mm]";
    }
    const int column = column_of(field);
    const auto factor = units.find(unit);
    if (factor == units.end())
      return problem(column, std::string(field), fmt::format("the unit {}", unit), need);
    if (content_ == TableContent::angles) {
      if (pose && name.find(".wrist.") != std::string::npos) return;
      if (name.ends_with(kTarget)) name.resize(name.size() - kTarget.size());
      table_.radians = table_.radians && factor->second == 1;
    }
    if (name.empty()) return problem(column, "", "a column without a name", "the name of a coordinate");
    kept_.push_back(index);
    if (!known_.insert(name).second)
      return problem(column, name, "a second column of this name", "a unique name for each column");
    table_.names.push_back(name);
    factors_.push_back(factor->second);
  }

  /// The labels after the time. @param factor to rad, of labels without a unit
  void read_labels(const std::vector<std::string_view>& labels, double factor) {
    struct Text {
      const char *none, *need;
    };
    // In the order of TableContent.
    constexpr Text kTexts[] = {
        {"no column of angles", "columns such as index_mcp.flexion[deg]"},
        {"no column of a wrist's pose", "columns such as right.wrist.x[m] and right.wrist.qw"},
        {"no column of a muscle", "columns such as FDP2 or right.FDP2"}};
    const Text& text = kTexts[static_cast<std::size_t>(content_)];
    for (std::size_t i = 1; i < labels.size(); ++i) read_label(labels[i], i, factor);
    if (problems_.empty() && kept_.empty()) problem(1, "", text.none, text.need);
    table_.header_line = number_;
  }

  void read_csv_header() {
    if (!next_line()) return problem(1, "", "an empty file", "a line of column names, then rows");
    const std::vector<std::string_view> fields = split(line_, ',');
    width_ = fields.size();
    if (fields[0] != "time" && fields[0] != "time[s]")
      problem(1, "", fmt::format("\"{}\"", fields[0]), "time[s] as the first column");
    read_labels(fields, 1);
  }

  void read_header_number(std::string_view key, std::string_view value, std::optional<std::size_t>& out) {
    const auto number = parse_number(value);
    constexpr double kMost = 1e9;
    if (number && *number >= 0 && *number <= kMost && *number == std::floor(*number))
      out = static_cast<std::size_t>(*number);
    else
      problem(1, std::string(key), fmt::format("\"{}\"", value), "a whole number, at most 1e9");
  }

  void read_opensim_header() {
    bool degrees = false, ended = false;
    std::optional<std::size_t> columns;
    while (!ended && next_line()) {
      const std::string_view line = trimmed(line_);
      if (line == "endheader") {
        ended = true;
        continue;
      }
      const std::size_t equals = line.find('=');
      if (equals == std::string_view::npos) continue;
      const std::string_view key = trimmed(line.substr(0, equals)), value = trimmed(line.substr(equals + 1));
      // Programs differ in the letters' case; a key that is not known would be left out without a word.
      const std::string known = lower_case(key);
      if (known == "nrows" || known == "datarows") read_header_number(key, value, stated_rows_);
      if (known == "ncolumns" || known == "datacolumns") read_header_number(key, value, columns);
      if (known == "indegrees") {
        degrees = lower_case(value) == "yes";
        if (!degrees && lower_case(value) != "no")
          problem(1, "inDegrees", fmt::format("\"{}\"", value), "yes or no");
      }
    }
    if (!ended) return problem(1, "", "no line `endheader`", "an OpenSim header that ends with it");
    if (!next_line()) return problem(1, "", "nothing after endheader", "a line of column labels, then rows");
    const std::vector<std::string_view> labels = split_blanks(line_);
    width_ = labels.size();
    if (labels.empty() || labels[0] != "time")
      return problem(1, "", labels.empty() ? "no labels" : fmt::format("\"{}\"", labels[0]),
                     "time as the first label");
    if (columns && *columns != width_)
      problem(1, "nColumns", fmt::format("{} labels", width_),
              fmt::format("{}, the value of nColumns", *columns));
    read_labels(labels, degrees ? kDegree : 1);
  }

  void read_row(const std::vector<std::string_view>& fields) {
    if (fields.size() != width_)
      return problem(1, "", fmt::format("{} values", fields.size()),
                     fmt::format("{}, one for each column", width_));
    const auto time = parse_number(fields[0]);
    if (!time) return problem(1, "time", fmt::format("\"{}\"", fields[0]), "a time in s");
    if (!table_.times.empty() && !(*time > table_.times.back()))
      return problem(1, "time", fmt::format("{:g} s after {:g} s", *time, table_.times.back()),
                     "increasing times");
    if (table_.times.size() == kMotionMaxRows) {
      problem(1, "", fmt::format("more than {} rows", kMotionMaxRows), "a shorter table");
      rest_ = {};
      return;
    }
    const std::size_t before = table_.values.size();
    for (std::size_t k = 0; k < kept_.size(); ++k) {
      std::string_view field = fields[kept_[k]];
      const auto value = parse_number(field);
      if (!value) {
        problem(column_of(field), table_.names[k], fmt::format("\"{}\"", field), "a finite number");
        table_.values.resize(before);
        return;
      }
      table_.values.push_back(*value * factors_[k]);
    }
    table_.times.push_back(*time);
    table_.lines.push_back(number_);
  }

  std::string name_;
  TableContent content_;
  std::string text_;
  std::string_view rest_, line_;
  int number_ = 0;
  std::size_t width_ = 0;
  std::vector<std::size_t> kept_;          ///< fields that are columns of the table
  std::vector<double> factors_;            ///< of those, to rad
  std::unordered_set<std::string> known_;  ///< names of the columns so far
  std::optional<std::size_t> stated_rows_;
  std::vector<Problem> problems_;
  MotionTable table_;
};

std::string suffix_of(const std::string& name) { return std::filesystem::path(name).extension().string(); }

}  // namespace

bool is_motion_file(const std::string& name) {
  const std::string suffix = suffix_of(name);
  return suffix == ".csv" || suffix == ".mot" || suffix == ".sto";
}

MotionTable read_motion(const std::filesystem::path& path, TableContent content) {
  return Reader(path, content).read(suffix_of(path.string()) != ".csv");
}

}  // namespace handsim::control
