#include "handsim/study/report.h"

#include <sys/utsname.h>
#include <time.h>

#include <algorithm>
#include <fstream>

#include <fmt/format.h>

#include "handsim/core/version.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/study/study_page.h"

namespace handsim::study {

namespace {

constexpr const char* kKinds[] = {".png", ".svg"};

std::string plot_commands(const Plot& plot) {
  return fmt::format(
      "do for [t in 'png svg'] {{\n  set output place('{0}.'.t)\n"
      "  if (t eq 'png') {{ set terminal pngcairo {1} }} else {{ set terminal svg {1} }}\n"
      "{2}  unset output\n}}\n",
      plot.name, plot.terminal, plot.commands);
}

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  std::string line;
  while (std::getline(file, line))
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown";
}

std::string operating_system() {
  utsname system{};
  uname(&system);
  return std::string(system.sysname) + " " + system.release;
}

}  // namespace

double cpu_now() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::string quoted(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  for (std::size_t at = 0; (at = text.find('"', at)) != std::string::npos; at += 2) text.insert(at, 1, '"');
  return "\"" + text + "\"";
}

void add_origin(Json& out) {
  out["machine"] = {{"processor", processor()}, {"system", operating_system()}};
  out["versions"] = {{"handsim", kVersion}, {"compiler", __VERSION__}};
}

bool write_report(const std::filesystem::path& out, const std::string& name, const Report& report) {
  output::make_folder(out);
  output::write_file(out / (name + ".csv"), report.csv);
  if (!report.json.empty()) output::write_file(out / (name + ".json"), report.json);
  std::string script = output::kPlotHead + std::string("set encoding utf8\n") + report.data;
  std::vector<std::string> files;
  for (const Plot& plot : report.plots) {
    script += plot_commands(plot);
    for (const char* kind : kKinds) files.push_back(plot.name + kind);
  }
  output::write_file(out / (name + ".gp"), script);
  return output::plot(name + ".gp", out, files);
}

std::vector<std::string> report_files(const std::string& name, const std::vector<std::string>& plots) {
  std::vector<std::string> out = {name + ".csv", name + ".json", name + ".gp", kStudyFile, kPageFile};
  for (const std::string& plot : plots)
    for (const char* kind : kKinds) out.push_back(plot + kind);
  return out;
}

}  // namespace handsim::study
