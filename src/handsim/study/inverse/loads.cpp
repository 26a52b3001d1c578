#include "handsim/study/inverse/loads.h"

#include <algorithm>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/input_file.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"
#include "handsim/output/table/csv_rows.h"

namespace handsim::study {

namespace {

constexpr std::size_t kMostBytes = 1U << 30U;
constexpr std::string_view kLoadHead = "time[s],body,x[m],y[m],z[m],force.x[N],force.y[N],force.z[N]";
/// Rows of one file.
class LoadReader {
 public:
  LoadReader(std::string file, const model::Model& model) : file_(std::move(file)) {
    for (std::size_t i = 0; i < model.bodies.size(); ++i) bodies_[model.bodies[i].name] = i;
    for (const model::Shape& shape : model.shapes) shapes_[shape.name] = handsim::as_index(shape.body);
  }
  void line(int number) { number_ = number; }
  [[noreturn]] void fail(std::string key, std::string got, std::string need) const {
    throw Error({Problem{Place{file_, number_, 1}, std::move(key), std::move(got), std::move(need)}});
  }
  double number(std::string_view text) const {
    const auto value = parse_number(text);
    if (!value) fail("", fmt::format("\"{}\"", text), "a finite number");
    return *value;
  }
  Vec3 vector(const std::vector<std::string_view>& fields, std::size_t first) const {
    return {number(fields[first]), number(fields[first + 1]), number(fields[first + 2])};
  }
  std::size_t body(std::string_view name) const { return find(bodies_, "body", name); }
  std::size_t shape(std::string_view name) const { return find(shapes_, "shape", name); }

 private:
  std::size_t find(const std::map<std::string, std::size_t, std::less<>>& in, const char* what,
                   std::string_view name) const {
    if (const auto found = in.find(name); found != in.end()) return found->second;
    std::vector<std::string> known;
    for (const auto& [each, index] : in) known.push_back(each);
    fail(what, fmt::format("\"{}\", unknown", name),
         fmt::format("a {} of the scene{}", what, nearest_hint(std::string(name), known)));
  }

  std::string file_;
  int number_ = 1;
  std::map<std::string, std::size_t, std::less<>> bodies_, shapes_;
};

}  // namespace

Loads::Loads(const std::filesystem::path& path, const model::Model& model) : courses_(model.bodies.size()) {
  const std::string text = read_text_file(path, "a table of forces (.csv)", kMostBytes);
  LoadReader reader(path.string(), model);
  std::string_view rest = text;
  const std::string_view head = rest.empty() ? rest : take_line(rest);
  contacts_ = std::string(head) + "\n" == output::contact_head();
  if (!contacts_ && head != kLoadHead)
    reader.fail("", fmt::format("\"{}\"", printable(head)),
                fmt::format("the header {}, or that of a contacts.csv", kLoadHead));
  const std::size_t width = split(head, ',').size();
  const auto add = [&](std::size_t body, double time, const Vec3& point, const Vec3& force) {
    model::Wrench& wrench = courses_[body][time];
    wrench.force += force;
    wrench.moment += point.cross(force);
  };
  for (int line = 2; !rest.empty(); ++line) {
    reader.line(line);
    const std::vector<std::string_view> fields = split(take_line(rest), ',');
    if (fields.size() == 1 && fields[0].empty()) continue;
    if (fields.size() != width)
      reader.fail("", fmt::format("{} values", fields.size()), fmt::format("{}, one for each column", width));
    const double time = reader.number(fields[0]);
    times_.push_back(time);
    if (!contacts_) {
      add(reader.body(fields[1]), time, reader.vector(fields, 2), reader.vector(fields, 5));
      continue;
    }
    const Vec3 point = reader.vector(fields, 3);
    const Vec3 force = reader.number(fields[10]) * reader.vector(fields, 6) + reader.vector(fields, 11);
    add(reader.shape(fields[1]), time, point, force);
    add(reader.shape(fields[2]), time, point, -force);
  }
  std::ranges::sort(times_);
  times_.erase(std::unique(times_.begin(), times_.end()), times_.end());
  if (contacts_) end_contacts();
}

/// Between rows that do not follow each other nothing acts.
void Loads::end_contacts() {
  double interval = 1e9;
  for (std::size_t i = 1; i < times_.size(); ++i) interval = std::min(interval, times_[i] - times_[i - 1]);
  for (Course& course : courses_) {
    std::vector<double> ends;
    double last = -1e9;
    for (const auto& [time, wrench] : course) {
      if (time - last > 1.5 * interval) ends.insert(ends.end(), {last + interval, time - interval});
      last = time;
    }
    if (!course.empty()) ends.push_back(last + interval);
    for (const double end : ends) course.emplace(end, model::Wrench{});
  }
}

void Loads::at(double time, std::span<const model::BodyMotion> bodies,
               std::vector<model::Wrench>& out) const {
  out.assign(courses_.size(), {});
  for (std::size_t i = 0; i < courses_.size(); ++i) {
    const Course& course = courses_[i];
    if (course.empty()) continue;
    const auto next = course.lower_bound(time);
    model::Wrench wrench;
    if (next == course.begin() || next == course.end()) {
      // Loads last beyond the table, contacts do not.
      if (!contacts_) wrench = next == course.begin() ? next->second : std::prev(next)->second;
    } else {
      const auto before = std::prev(next);
      const double share = (time - before->first) / (next->first - before->first);
      wrench.force = (1 - share) * before->second.force + share * next->second.force;
      wrench.moment = (1 - share) * before->second.moment + share * next->second.moment;
    }
    wrench.moment -= bodies[i].p.cross(wrench.force);
    out[i] = wrench;
  }
}

}  // namespace handsim::study
